"""Poses obey the laws of rigid motions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from buildarena_geometry import Pose

coordinates = st.floats(-100, 100)
points = st.tuples(coordinates, coordinates, coordinates)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.01)
poses = st.builds(lambda p, q: Pose(position=p, quaternion=q), points, quaternions)


def assert_close(left: Pose, right: Pose):
    assert np.allclose(left.position, right.position, atol=1e-9)
    assert np.allclose(left.rotation, right.rotation, atol=1e-12)


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert_close((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_the_identity_changes_nothing(pose):
    assert_close(pose @ Pose(), pose)
    assert_close(Pose() @ pose, pose)


@given(poses)
def test_a_pose_and_its_inverse_cancel(pose):
    assert_close(pose @ pose.inverse(), Pose())
    assert_close(pose.inverse() @ pose, Pose())


@given(poses, poses, points)
def test_a_composition_acts_like_its_parts_one_after_the_other(a, b, point):
    assert np.allclose((a @ b).apply(point), a.apply(b.apply(point)), atol=1e-9)


@given(poses, points, points)
def test_poses_keep_distances(pose, left, right):
    moved = math.dist(pose.apply(left), pose.apply(right))
    assert moved == pytest.approx(math.dist(left, right), abs=1e-9)


@given(poses)
def test_rotations_are_proper(pose):
    assert np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1)


@given(poses)
def test_a_pose_rebuilt_from_its_parts_is_the_very_same(pose):
    assert Pose(position=pose.position, quaternion=pose.quaternion) == pose


@given(poses)
def test_opposite_quaternions_make_equal_poses(pose):
    assert_close(Pose(position=pose.position, quaternion=-pose.quaternion), pose)


def test_many_points_move_as_each_of_them():
    pose = Pose(position=(1, 2, 3), quaternion=(1, 0, 0, 1))
    cloud = np.arange(12.0).reshape(4, 3)
    assert np.allclose(pose.apply(cloud), [pose.apply(point) for point in cloud])


def test_a_quarter_turn_about_the_vertical_takes_east_to_north():
    quarter = Pose(quaternion=(1, 0, 0, 1))
    assert np.allclose(quarter.apply((1, 0, 0)), (0, 1, 0))


def test_arrays_of_a_pose_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        Pose().position[0] = 1


@pytest.mark.parametrize(
    ("position", "quaternion", "message"),
    [
        ((1, 2), (1, 0, 0, 0), "three finite numbers"),
        ((1, 2, math.nan), (1, 0, 0, 0), "three finite numbers"),
        ((1, 2, 3), (1, 0, 0), "four finite numbers"),
        ((1, 2, 3), (1, 0, 0, math.inf), "four finite numbers"),
        ((1, 2, 3), (0, 0, 0, 0), "has a length"),
    ],
)
def test_a_pose_refuses_parts_that_are_none(position, quaternion, message):
    with pytest.raises(ValueError, match=message):
        Pose(position=position, quaternion=quaternion)
