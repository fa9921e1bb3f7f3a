"""Diagrams of walks."""


def test_diagram_has_zmp_and_dcm_of_each_walk(tmp_path):
    """Two robots that stand for a few cycles."""
    from biped import Biped
    from diagrams import LINES, draw_walks
    from walker import Walker

    walkers = []

    def stand(each):
        robot = Biped(proximity=False)
        walkers.append(Walker(robot, []))
        for _ in range(3):
            robot.step(*walkers[-1].cycle(robot.senses()))
            each(robot, walkers[-1])

    draw_walks({"one": stand, "other": stand}, tmp_path / "diagram.png")
    assert (tmp_path / "diagram.png").stat().st_size > 10_000 and len(walkers) == 2
    row = walkers[0].log.rows[-1]
    low, high = row["limits"]
    assert (low <= row["wanted"]).all() and (row["wanted"] <= high).all() and all(key in row for key, *_ in LINES)
