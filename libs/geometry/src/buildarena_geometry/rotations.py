"""Vectors and rotations as plain floats: the arithmetic under poses."""

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)
NO_ROTATION: Quaternion = (1.0, 0.0, 0.0, 0.0)
SHORTEST_QUATERNION = 1e-9  # a shorter one has no reliable direction
SIGN_TOLERANCE = 1e-12  # a smaller component is rounding error and does not determine the sign


def multiply(left: Quaternion, right: Quaternion) -> Quaternion:
    """Return the Hamilton product: the rotation `right` followed by the rotation `left`."""
    a, b, c, d = left
    w, x, y, z = right
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def rotate(quaternion: Quaternion, vector: Vector) -> Vector:
    """Rotate a vector by a unit quaternion."""
    w, x, y, z = quaternion
    a, b, c = vector
    # v + w t + q x t, where t = 2 q x v and x is the vector product
    t, u, v = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * t + y * v - z * u, b + w * u + z * t - x * v, c + w * v + x * u - y * t)


def about_axis(axis: Vector, angle_deg: float) -> Quaternion:
    """Return the right-handed rotation about an axis.

    Args:
        axis: unit length.
        angle_deg: degrees, counter-clockwise seen from the axis's tip.

    Returns:
        A unit quaternion; multiples of 360° give exactly no rotation.
    """
    half = math.radians(math.remainder(angle_deg, 360.0)) / 2
    sine = math.sin(half)
    return positive((math.cos(half), axis[0] * sine, axis[1] * sine, axis[2] * sine))


def from_axes(x_axis: Vector, z_axis: Vector) -> Quaternion:
    """Return the rotation of a frame whose x and z axes are given in the outer frame.

    Args:
        x_axis: unit length, perpendicular to z_axis.
        z_axis: unit length.

    Returns:
        A unit quaternion.
    """
    y_axis = cross(z_axis, x_axis)
    (a, d, g), (b, e, h), (c, f, i) = x_axis, y_axis, z_axis  # columns of the rotation matrix
    # The largest of the four squared components is taken first: its square root divides the others.
    squares = (1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i)
    largest = max(range(4), key=squares.__getitem__)
    rows = (
        (squares[0], h - f, c - g, d - b),
        (h - f, squares[1], d + b, c + g),
        (c - g, d + b, squares[2], h + f),
        (d - b, c + g, h + f, squares[3]),
    )
    return normalized(rows[largest])


def rotation_rows(quaternion: Quaternion) -> tuple[Vector, Vector, Vector]:
    """Return the rotation matrix of a unit quaternion, row by row."""
    w, x, y, z = quaternion
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def normalized(quaternion: tuple[float, ...]) -> Quaternion:
    """Scale a quaternion to unit length, with its first component that is not zero positive.

    One that is of unit length up to rounding keeps its bits, so that a pose read back from a
    document is the very pose that was written.
    """
    w, x, y, z = quaternion
    squared = w * w + x * x + y * y + z * z
    if abs(squared - 1) > 1e-15:  # noqa: PLR2004  a few times the rounding of the sum above
        scale = 1 / math.sqrt(squared)
        w, x, y, z = w * scale, x * scale, y * scale, z * scale
    return positive((w, x, y, z))


def positive(quaternion: Quaternion) -> Quaternion:
    """Return the one of a rotation's two quaternions whose first nonzero component is positive."""
    for component in quaternion:
        if component > SIGN_TOLERANCE:
            return quaternion
        if component < -SIGN_TOLERANCE:
            w, x, y, z = quaternion
            return (-w, -x, -y, -z)
    return quaternion


def add(left: Vector, right: Vector) -> Vector:
    """Return the sum of two vectors."""
    return (left[0] + right[0], left[1] + right[1], left[2] + right[2])


def subtract(left: Vector, right: Vector) -> Vector:
    """Return the vector that leads from `right` to `left`."""
    return (left[0] - right[0], left[1] - right[1], left[2] - right[2])


def scaled(vector: Vector, factor: float) -> Vector:
    """Return the vector times a number."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def dot(left: Vector, right: Vector) -> float:
    """Return the scalar product."""
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


def cross(left: Vector, right: Vector) -> Vector:
    """Return the right-handed vector product."""
    a, b, c = left
    x, y, z = right
    return (b * z - c * y, c * x - a * z, a * y - b * x)
