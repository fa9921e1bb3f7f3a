"""Options, tables and their places in the documentation, which all experiments have in common."""

import importlib
import signal
from types import SimpleNamespace

import pytest


def test_each_table_is_in_a_page():
    """The results of each experiment are there, and a page includes or names them."""
    from experiment import RESULTS, ROOT

    text = "".join(page.read_text("utf-8") for page in (ROOT / "docs" / "control").glob("*.md"))
    scripts = {path.stem: path.read_text("utf-8") for path in (ROOT / "control" / "examples").glob("*.py")}
    scripts = {name for name, source in scripts.items() if "report(given," in source}
    assert {path.stem for path in RESULTS.glob("*.md")} == scripts
    assert {name for name in scripts if f"control/results/{name}.md" not in text} == set()


def test_table_is_written_where_pages_include_it(monkeypatch, tmp_path, capsys):
    """The file is what is printed."""
    import experiment

    monkeypatch.setattr(experiment, "RESULTS", tmp_path)
    experiment.report(SimpleNamespace(name="beam", seeds=2, write=True), ["assumed", "stands"], [["full sole", "0/2"]])
    table = "| assumed (2 seeds) | stands |\n| ----------------- | ------ |\n| full sole         | 0/2    |\n"
    assert (tmp_path / "beam.md").read_text() == table and table in capsys.readouterr().out


@pytest.mark.parametrize(
    ("script", "words", "problem"),
    [
        ("landing", "--seeds 0", "--seeds: '0' is not a whole number of at least 1"),
        ("wrenches", "--seeds 0", "--seeds: '0' is not a whole number of at least 1"),
        ("balance", "--jobs -1", "--jobs: '-1' is not a whole number of at least 1"),
        ("faults", "--steps 0", "--steps: '0' is not a whole number of at least 1"),
        ("g1_landing", "--steps 1.5", "--steps: '1.5' is not a whole number of at least 1"),
        ("beam", "--width -0.1", "--width: '-0.1' is not a number above 0"),
        ("landing", "--speed nan", "--speed: 'nan' is not a number above 0"),
        ("footholds", "--out {file}/out", "--out: cannot write to the folder {file}/out: Not a directory"),
        ("g1", "--urdf {file}", "--urdf: {file} is not an XML file"),
        ("g1", "--urdf {other}", "--urdf: {other} is not the URDF of a G1: it has no link 'left_ankle_roll_link'"),
        ("g1_arm", "--urdf {file}.urdf", "--urdf: cannot read {file}.urdf: No such file"),
        ("rates", "--no-animation", "unrecognized arguments: --no-animation"),
        ("as_written", "--no-animation", "unrecognized arguments: --no-animation"),
    ],
)
def test_bad_option_is_one_message(script, words, problem, tmp_path, monkeypatch, capsys):
    """The exit code is 2, and nothing is simulated."""
    file, other = tmp_path / "file", tmp_path / "other.urdf"
    file.write_text("no XML")
    other.write_text("<robot name='other'><link name='pelvis'/></robot>")
    names = {"file": file, "other": other}
    monkeypatch.setattr("sys.argv", [f"{script}.py", *words.format(**names).split()])
    module = importlib.import_module(script)
    monkeypatch.setattr(module, "run_all", lambda *_: pytest.fail("the experiment runs"))
    with pytest.raises(SystemExit) as ended:
        module.main()
    assert ended.value.code == 2 and problem.format(**names) in capsys.readouterr().err


def test_processes_of_an_experiment_ignore_ctrl_c_from_their_start(monkeypatch):
    """They printed tracebacks if it came while they started; the main process reports it, and goes on to do so."""
    import experiment

    seen = []

    class Pool:
        def __init__(self, jobs):
            seen.append((jobs, signal.getsignal(signal.SIGINT)))

        def __enter__(self):
            return self

        def __exit__(self, *_):
            seen.append(signal.getsignal(signal.SIGINT))

        def imap(self, work, cases):
            return map(work, cases)

    monkeypatch.setattr(experiment, "get_context", lambda _: SimpleNamespace(Pool=Pool))
    before = signal.getsignal(signal.SIGINT)
    assert experiment.run_all(abs, {"a": [-1], "b": [2, -3]}, SimpleNamespace(jobs=3)) == {"a": [1], "b": [2, 3]}
    assert seen == [(3, signal.SIG_IGN), before]


def test_animation_has_two_runs_next_to_each_other_the_shorter_of_which_stands_still(frames, tmp_path):
    """A robot that is lifted, in three and in five frames."""
    import mujoco
    from biped import PERIOD, Biped
    from experiment import SIZE, film_both

    robot = Biped(proximity=False)

    def lifted(count):
        def run(each):
            for k in range(count):
                robot.data.time, robot.data.qpos[2] = k * PERIOD, 0.9 + 0.2 * k
                mujoco.mj_kinematics(robot.model, robot.data)
                each(robot)

        return run

    film_both([lifted(3), lifted(5)], tmp_path / "film" / "both.gif", azimuth=90)
    film = frames(tmp_path / "film" / "both.gif")
    assert film.shape == (5, SIZE[0], 2 * SIZE[1], 3)
    left, right = film[:, :, : SIZE[1]], film[:, :, SIZE[1] :]
    changes = [[int((abs(a - b) > 20).any(axis=-1).sum()) for a, b in zip(half, half[1:])] for half in (left, right)]
    assert min(changes[1]) > 500 and min(changes[0][:2]) > 500 and changes[0][2:] == [0, 0]
