"""Sphinx's settings for the site: `make docs` builds it into build/site, without the network."""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import bilayer_core  # noqa: E402
from bilayer_core.model.force_list import markdown_table  # noqa: E402
from bilayer_core.scene.key_tables import page  # noqa: E402
from bilayer_sim_ros.node.parameters import REPLAY_NODE, SIM_NODE, NodeParameter  # noqa: E402

# Tables that are made, not written: pages include them.
MADE = ROOT / "build" / "pages"
MADE.mkdir(parents=True, exist_ok=True)
VALIDATED = ROOT / "runs" / "validation" / "validation.md"
NOT_VALIDATED = "This site was built without them: `make evidence docs` computes and includes them.\n"


def parameters(table: tuple[NodeParameter, ...]) -> str:
    """Return the parameters of a node as a table."""
    rows = ["| parameter | default | meaning | allowed | may be set |", "| --- | --- | --- | --- | --- |"]
    for of in table:
        when = "at any time" if of.live else "at the start"
        cells = (f"`{of.name}`", f"`{json.dumps(of.default)}`", of.description, of.allowed, when)
        rows.append(f"| {' | '.join(cells)} |".replace("<", "&lt;"))
    return "\n".join(rows) + "\n"


for name, text in {
    "scene_keys.md": page().partition("\n")[2],  # the title is the page's own
    "forces.md": markdown_table(),
    "sim_node.md": parameters(SIM_NODE),
    "replay_node.md": parameters(REPLAY_NODE),
    "validation.md": VALIDATED.read_text(encoding="utf-8") if VALIDATED.exists() else NOT_VALIDATED,
}.items():
    path = MADE / name
    if not path.exists() or path.read_text(encoding="utf-8") != text:  # else Sphinx would read its page again
        path.write_text(text, encoding="utf-8")

project = "bilayer_sim_ros"
author = "the authors of bilayer_sim_ros"
version = release = bilayer_core.__version__
extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
nb_execution_in_temp = True  # logs and pictures of notebooks are not kept
nb_execution_raise_on_error = True
nb_execution_timeout = 300
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
html_theme = "pydata_sphinx_theme"
html_title = "bilayer_sim_ros"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"secondary_sidebar_items": ["page-toc"], "footer_end": [], "show_prev_next": False}
html_context = {"default_mode": "auto"}
