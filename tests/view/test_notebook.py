"""What notebooks show of simulators, runs and fits."""

import io
import sys
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from support.sample_scenes import everything

from bilayer_core import Recorder, Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.printable import html_table
from bilayer_core.simulation import progress_bar
from bilayer_core.view import notebook


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A simulator, the result of its run with a log, and a recorder."""
    simulator = Simulator(load_scene(everything()))
    recorder = Recorder(simulator, ["com", "energy/*"], rate=100.0)
    return simulator, simulator.run(0.1, log=tmp_path_factory.mktemp("log") / "run.mcap"), recorder


class Cells(HTMLParser):
    """The texts of a table, whose tags must close."""

    def __init__(self, html):
        super().__init__()
        self.open, self.texts = [], []
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def test_simulators_runs_and_logs_show_themselves_as_tables(ran):
    simulator, run, recorder = ran
    assert {"sample: A sample", "0.1 of 1 s"} <= set(Cells(simulator._repr_html_()).texts)
    texts = Cells(run._repr_html_()).texts
    assert texts[0] == "Run completed" and str(run.steps) in texts and run.log in texts
    texts = Cells(run.data._repr_html_()).texts
    assert texts[0] == "Run of sample" and "body/ball" in texts and "0 to 0.1 s, 6 frames" in texts
    assert any("kinetic [J]" in text for text in Cells(recorder._repr_html_()).texts)


def test_names_of_others_do_not_become_tags():
    assert Cells(html_table("<script>", {"<b>": "a & b"})).texts == ["<script>", "<b>", "a & b"]


def test_runs_and_recorders_draw_their_quantities(ran):
    from matplotlib import pyplot

    (_, run, recorder), open_before = ran, pyplot.get_fignums()
    figure = run.plot("com.z", "rod/arm_0/position.x", "energy/*")
    assert [axes.get_ylabel() for axes in figure.axes] == ["position [mm]", "energy [mJ]"]
    drawn = recorder.plot("com.z").axes[0].lines[0]
    np.testing.assert_allclose(drawn.get_xdata(), recorder.times)
    assert pyplot.get_fignums() == open_before  # else the notebook would show it twice
    with pytest.raises(InputError, match="quantity 'com2': there is none; near it: com"):
        run.plot("com2")
    with pytest.raises(InputError, match="name at least one quantity"):
        run.plot()


def test_a_run_without_a_log_says_what_it_takes(ran):
    simulator, _, _ = ran
    with pytest.raises(InputError, match=r"wrote no log, .* give run\(log=FILE\), or use a Recorder"):
        simulator.run(0.01).plot("com")


def test_a_log_is_replaced_only_on_demand(ran, tmp_path):
    simulator, path = Simulator(load_scene(everything())), tmp_path / "run.mcap"
    simulator.run(0.02, log=path)
    with pytest.raises(InputError, match="exists"):
        simulator.run(0.02, log=path)
    assert simulator.run(0.04, log=path, overwrite=True).data.times[-1] == pytest.approx(0.06)


def test_films_and_pictures_are_those_of_the_run(ran, tmp_path, monkeypatch):
    pytest.importorskip("vtkmodules")
    monkeypatch.setattr(notebook, "find_spec", lambda name: None)  # without rerun-notebook
    simulator, run, _ = ran
    film = run.film(seconds=0.4, camera="side", size=(320, 240))
    moving = Image.open(io.BytesIO(film.content))
    assert (moving.format, moving.n_frames, moving.size) == ("WEBP", 6, (320, 240))
    film.save(tmp_path / "film.webp")
    assert (tmp_path / "film.webp").read_bytes() == film.content
    shown = simulator.show(size=(320, 240))
    assert Image.open(io.BytesIO(shown.content)).size == (320, 240)
    assert shown._repr_html_().startswith("<img style='max-width:100%' src='data:image/png;base64,iVBOR")
    for asked, told in (
        (lambda: run.film(0.0), "film: found 0 s"),
        (lambda: simulator.show(camra="side"), "camra: is no word about a picture; allowed are camera"),
        (lambda: film.save("film.gif"), "film.gif: must end in .webp"),
    ):
        with pytest.raises(InputError, match=told):
            asked()


def test_a_bar_shows_how_far_a_run_is(monkeypatch):
    shown = []
    handle = SimpleNamespace(update=shown.append)
    monkeypatch.setattr(progress_bar, "in_notebook", lambda: True)
    display = SimpleNamespace(HTML=str, display=lambda what, display_id: shown.append(what) or handle)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    simulator = Simulator(load_scene(everything()))
    simulator.run(0.05, progress=True)
    assert shown[0].startswith("sample <progress value='0' max='0.05'>") and "0.05/0.05 s" in shown[-1]
