from __future__ import annotations

from learning.segments import PARENTS, SEGMENTS


def test_parents_come_first_and_belong_to_the_same_side() -> None:
    assert len(PARENTS) == len(SEGMENTS) == len(set(SEGMENTS)) == 19
    assert PARENTS[0] == -1
    for child, parent in enumerate(PARENTS[1:], start=1):
        assert 0 <= parent < child
        side, other = (SEGMENTS[n].partition("_")[0] for n in (child, parent))
        assert other in (side, "hips", "chest") or side not in ("left", "right")


def test_the_arm_hangs_on_the_chest() -> None:
    name = "left_hand"
    chain = [name]
    while PARENTS[SEGMENTS.index(name)] >= 0:
        name = SEGMENTS[PARENTS[SEGMENTS.index(name)]]
        chain.append(name)
    assert chain[1:] == [
        *("left_forearm", "left_upper_arm", "left_collar", "chest", "spine", "hips"),
    ]
