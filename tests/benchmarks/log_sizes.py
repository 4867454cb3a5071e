"""The forecast of `bilayer check` beside the size of the log that `bilayer run --log` writes, for all bundled scenes.

python tests/benchmarks/log_sizes.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]


def main() -> None:
    from bilayer_core import Simulator, load_scene
    from bilayer_core.cli import main as bilayer
    from bilayer_core.runs.forecast import forecast
    from bilayer_core.scene.bundled import bundled_scenes

    print("| scene | forecast | written | ratio |\n| --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as directory:
        for scene in bundled_scenes():
            expected = forecast(Simulator(load_scene(scene))).total
            log = Path(directory) / f"{scene}.mcap"
            if code := bilayer(["run", scene, "--log", str(log), "--quiet"]):
                raise SystemExit(code)
            written = log.stat().st_size
            print(
                f"| `{scene}` | {expected / 1e6:.3g} MB | {written / 1e6:.3g} MB | {expected / written:.2f} |",
                flush=True,
            )
            log.unlink()


if __name__ == "__main__":
    main()
