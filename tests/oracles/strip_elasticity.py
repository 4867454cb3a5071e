"""A strip of two bonded layers by finite elements, with no code of the package: torsion of its section by both energy
principles, between whose answers the true one lies, and in space with clamped ends.

Elements are quadratic, on products of lines, so matrices are Kronecker products of those of lines.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(3)
SHAPE = np.array([POINTS * (POINTS - 1) / 2, 1 - POINTS**2, POINTS * (POINTS + 1) / 2])
SLOPE = np.array([POINTS - 0.5, -2 * POINTS, POINTS + 0.5])


def line(corners, weight=1.0):
    """∫ c N Nᵀ, ∫ c N′ Nᵀ, ∫ c N′ N′ᵀ of quadratic elements between corners, `weight` c of each."""
    half, weight = np.diff(corners) / 2, weight * np.ones(len(corners) - 1)
    nodes = 2 * np.arange(len(half))[:, None] + np.arange(3)
    rows, columns = np.repeat(nodes, 3, axis=1).ravel(), np.tile(nodes, (1, 3)).ravel()
    return [
        sparse.csr_matrix((np.outer(weight * half**power, (a * WEIGHTS) @ b.T).ravel(), (rows, columns)))
        for a, b, power in ((SHAPE, SHAPE, 1), (SLOPE, SHAPE, 0), (SLOPE, SLOPE, -1))
    ]


def with_middles(corners):
    """Nodes of the elements between corners."""
    return np.sort(np.concatenate([corners, (corners[1:] + corners[:-1]) / 2]))


def graded(start, end, count):
    """Corners that crowd at both ends."""
    return start + (end - start) * (1 - np.cos(np.pi * np.arange(count + 1) / count)) / 2


def _sums(matrix):
    return matrix @ np.ones(matrix.shape[1])


def section_torsion(shear_moduli, thickness, width, count):
    """Bounds of GJ from below and above: Prandtl's stress function, and St-Venant's warping ω. A pair of widths is that
    of the two layers, whose middles are one over the other; ∞ stands for the bound from above then.

    GJ = max 4 ∫∫ Φ − ∫∫ |∇Φ|²/G with Φ = 0 on the outline, = min ∫∫ G [(∂ω/∂y − z)² + (∂ω/∂z + y)²].
    """
    unlike = np.ndim(width) > 0
    widths, width = np.broadcast_to(width, 2), np.max(width)
    y = graded(-width / 2, width / 2, 2 * count)
    if unlike:
        half = min(widths) / 2
        border = graded(half, width / 2, count)
        y = np.concatenate([-border[::-1], graded(-half, half, 2 * count)[1:-1], border])
    z = np.concatenate([graded(-thickness[0], 0, count), graded(0, thickness[1], count)[1:]])
    g = np.repeat(shear_moduli, count)
    nodes_y, nodes_z = with_middles(y), with_middles(z)
    mass_y, gradient_y, stiff_y = line(y)

    mass_z, _, stiff_z = line(z, 1 / g)
    system = (sparse.kron(stiff_y, mass_z) + sparse.kron(mass_y, stiff_z)).tocsc()
    inside = np.pad(np.ones((len(nodes_y) - 2, len(nodes_z) - 2), bool), 1)
    rounding = 1e-9 * width
    for own, outer in zip(widths, (nodes_z <= rounding, nodes_z >= -rounding), strict=True):
        inside &= (abs(nodes_y) < own / 2 - rounding)[:, None] | ~outer
    inside = inside.ravel()
    load = 2 * np.kron(_sums(mass_y), _sums(line(z)[0]))[inside]
    low = load @ spsolve(system[inside][:, inside], load)
    if unlike:
        return low, np.inf

    mass_z, gradient_z, stiff_z = line(z, g)
    system = (sparse.kron(stiff_y, mass_z) + sparse.kron(mass_y, stiff_z)).tocsc()
    load = np.kron(_sums(gradient_y), mass_z @ nodes_z) - np.kron(mass_y @ nodes_y, _sums(gradient_z))
    rigid = width * (nodes_z @ (mass_z @ nodes_z)) + nodes_y @ (mass_y @ nodes_y) * mass_z.sum()
    return low, rigid - load[1:] @ spsolve(system[1:, 1:], load[1:])


def clamped_twist(moduli, poisson, thickness, width, length, counts=(24, 6, 1)):
    """Torque over the angle between the ends of a strip in space, all of whose points there are held."""
    shear, bulk = (np.array(moduli) / (1 + poisson) * f for f in (0.5, poisson / (1 - 2 * poisson)))
    part = np.linspace(-1, 1, counts[0] + 1)
    x = length / 2 * np.sign(part) * (1 - (1 - abs(part)) ** 1.6)
    y = width / 2 * np.sin(np.pi / 2 * np.linspace(-1, 1, counts[1] + 1))
    z = np.concatenate([np.linspace(-thickness[0], 0, counts[2] + 1), np.linspace(0, thickness[1], counts[2] + 1)[1:]])
    weight = np.array(moduli) * thickness
    z -= weight @ [-thickness[0], thickness[1]] / 2 / weight.sum()
    along_x, along_y = line(x), line(y)
    along_z = [line(z, np.repeat(constant, counts[2])) for constant in (bulk, shear)]

    def product(i, j, of_z):  # ∫ c ∂N/∂x_i ∂Nᵀ/∂x_j
        factors = []
        for axis, (mass, gradient, stiff) in enumerate((along_x, along_y, of_z)):
            factors.append(stiff if i == j == axis else gradient if i == axis else gradient.T if j == axis else mass)
        return sparse.kron(sparse.kron(factors[0], factors[1]), factors[2])

    laplace = sum(product(i, i, along_z[1]) for i in range(3))
    system = sparse.bmat(
        [
            [
                product(i, j, along_z[0]) + product(j, i, along_z[1]) + (laplace if i == j else 0 * laplace)
                for j in range(3)
            ]
            for i in range(3)
        ]
    ).tocsr()
    at = np.stack(np.meshgrid(*map(with_middles, (x, y, z)), indexing="ij"), axis=-1).reshape(-1, 3)
    held = np.tile(np.isclose(abs(at[:, 0]), length / 2), 3)
    turned = np.sign(at[:, 0]) / 2
    moved = held * np.concatenate([0 * turned, -turned * at[:, 2], turned * at[:, 1]])
    moved[~held] = spsolve(system[~held][:, ~held].tocsc(), -(system @ moved)[~held])
    return moved @ (system @ moved)
