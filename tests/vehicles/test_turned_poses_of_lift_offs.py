"""A vehicle in the air whose poses turn with the axes of the stream comes down, instead of falling."""

import pytest

from rcopterx.vehicles.lift_off import LiftOffLimits, LiftOffProof, SeenPose

U_HOVER, FRAME_S, CLIMB_M_S = 0.55, 0.02, 0.4


def climbing() -> tuple[LiftOffProof, float, float]:
    """A lift-off up to 8 cm, and the time and the height of its last pose."""
    proof = LiftOffProof("h1", LiftOffLimits(hover_thrust=U_HOVER), trust_repeated=False)
    now_s = height_m = 0.0
    while height_m < 0.08:
        now_s += FRAME_S
        if now_s > 1.0:
            proof.thrust(1.05 * U_HOVER, FRAME_S, stands=False)
        height_m = max(0.0, CLIMB_M_S * (now_s - 1.5))
        proof.own(SeenPose((1e-4 * round(now_s / FRAME_S % 3), 0.0, height_m), 0.01), now_s)
    assert proof.problem is None
    return proof, now_s, height_m


def test_a_pose_that_jumps_to_a_great_tilt_does_not_end_the_descent() -> None:
    proof, now_s, height_m = climbing()
    for number in range(20):
        now_s += FRAME_S
        proof.own(SeenPose((0.0, height_m + 1e-4 * number, 0.0), 1.8), now_s)
        proof.thrust(proof.sinking_thrust, FRAME_S, stands=False)
        assert proof.problem == "its pose jumped"
        assert proof.sinking


@pytest.mark.parametrize("tilt_rad", [0.5, 1.8])
def test_a_vehicle_that_tilts_where_it_was_seen_last_is_cut(tilt_rad: float) -> None:
    proof, now_s, height_m = climbing()
    for number in range(1, 4):
        now_s += FRAME_S
        proof.own(SeenPose((0.0, 1e-4 * number, height_m + CLIMB_M_S * number * FRAME_S), tilt_rad), now_s)
    assert proof.problem is not None
    assert "tilted" in proof.problem
    assert not proof.sinking
