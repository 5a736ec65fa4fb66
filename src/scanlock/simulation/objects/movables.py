"""Low things that people move: pallets, boxes, trolleys, seats, desks, shelves and containers.

Every object is at the origin of its own frame, on the ground, with z up.
"""

import numpy as np

from scanlock.simulation.objects.furniture import bins
from scanlock.simulation.objects.shapes import blocks, boxes, cones, ellipsoids
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces

_THING = SurfaceClass.FURNITURE


def crate(rng: np.random.Generator) -> Surfaces:
    """Generate a box of 0.3 to 0.9 m, turned at random, often with a smaller one on it."""
    half = 0.5 * rng.uniform([0.3, 0.3, 0.3], [0.9, 0.7, 0.9])
    lower = boxes([[0.0, 0.0, half[2]]], [half], _THING)
    if rng.random() < 0.5:
        return lower
    top = half * rng.uniform(0.4, 0.9, 3)
    offset = rng.uniform(-1.0, 1.0, 2) * (half - top)[:2]
    return Surfaces.joined([lower, boxes([[*offset, 2.0 * half[2] + top[2]]], [top], _THING)])


def pallet(rng: np.random.Generator) -> Surfaces:
    """Generate a pallet of 1.2 x 0.8 m with a load of up to 1.6 m, or empty ones in a stack."""
    if rng.random() < 0.2:
        return boxes([[0.0, 0.0, h := 0.072 * float(rng.integers(2, 12))]], [[0.6, 0.4, h]], _THING)
    high = rng.uniform(0.3, 1.6)
    out = rng.uniform(0.7, 1.0, 2) * [0.6, 0.4]
    load = (-out[0], out[0], -out[1], out[1], 0.144, 0.144 + high)
    return blocks([(-0.6, 0.6, -0.4, 0.4, 0.0, 0.144), load], _THING)


def rack_load(rng: np.random.Generator) -> Surfaces:
    """Generate the load of one place in a rack: a box of 0.8 to 1.15 m, up to 1.2 m high."""
    half = 0.5 * rng.uniform([0.8, 0.7, 0.35], [1.15, 1.0, 1.2])
    return boxes([[*rng.uniform(-0.06, 0.06, 2), half[2]]], [half], _THING)


def trolley(rng: np.random.Generator) -> Surfaces:
    """Generate a cart with a deck, a handle and a load."""
    length, width = rng.uniform(0.7, 1.1), rng.uniform(0.45, 0.65)
    load = rng.uniform(0.05, 0.6)
    x, y = 0.5 * length, 0.5 * width
    return blocks(
        [
            (-x, x, -y, y, 0.15, 0.22),
            (-x, -x + 0.04, -y, y, 0.0, rng.uniform(0.85, 1.05)),
            (-0.8 * x, 0.9 * x, -0.9 * y, 0.9 * y, 0.22, 0.22 + load),
        ],
        _THING,
    )


def forklift(rng: np.random.Generator) -> Surfaces:
    """Generate a forklift: body, mast, fork and roof on posts."""
    mast = rng.uniform(2.0, 2.6)
    body = blocks(
        [
            (-0.9, 0.7, -0.55, 0.55, 0.15, 1.0),
            (-0.7, -0.3, -0.5, 0.5, 0.0, 0.15),
            (0.2, 0.6, -0.5, 0.5, 0.0, 0.15),
            (0.7, 0.85, -0.4, 0.4, 0.05, mast),
            (0.85, 1.9, -0.35, -0.2, 0.05, 0.1),
            (0.85, 1.9, 0.2, 0.35, 0.05, 0.1),
            (-0.8, 0.5, -0.5, 0.5, 2.0, 2.08),
        ],
        SurfaceClass.CAR,
    )
    feet = [[x, y, 1.0] for x in (-0.7, 0.4) for y in (-0.45, 0.45)]
    heads = [[x, y, 2.0] for x in (-0.7, 0.4) for y in (-0.45, 0.45)]
    return Surfaces.joined([body, cones(feet, heads, 0.04, 0.04, SurfaceClass.CAR)])


def traffic_cone(rng: np.random.Generator) -> Surfaces:
    """Generate a traffic cone of 0.5 to 0.9 m."""
    height = rng.uniform(0.5, 0.9)
    return cones([[0.0, 0.0, 0.0]], [[0.0, 0.0, height]], 0.3 * height, 0.03, _THING)


def chair(rng: np.random.Generator) -> Surfaces:
    """Generate a chair with four legs and a back."""
    seat, back = rng.uniform(0.42, 0.5), rng.uniform(0.78, 1.0)
    half = rng.uniform(0.19, 0.25)
    inner = half - 0.03
    feet = np.array([[x, y, 0.0] for x in (-inner, inner) for y in (-inner, inner)])
    legs = cones(feet, feet + np.array([0.0, 0.0, seat]), 0.02, 0.02, _THING)
    plates = blocks(
        [
            (-half, half, -half, half, seat - 0.04, seat),
            (-half, -half + 0.04, -half, half, seat, back),
        ],
        _THING,
    )
    return Surfaces.joined([legs, plates])


def table(rng: np.random.Generator) -> Surfaces:
    """Generate a desk or a table with four legs, often with a screen on it."""
    x, y, z = 0.5 * rng.uniform(1.2, 1.8), 0.5 * rng.uniform(0.7, 0.9), rng.uniform(0.7, 0.76)
    spans = [(-x, x, -y, y, z - 0.03, z)]
    if rng.random() < 0.6:
        at = rng.uniform(-0.5, 0.5) * x
        spans.append((at - 0.28, at + 0.28, 0.4 * y, 0.4 * y + 0.05, z + 0.08, z + 0.45))
    feet = np.array([[u, v, 0.0] for u in (0.04 - x, x - 0.04) for v in (0.04 - y, y - 0.04)])
    legs = cones(feet, feet + np.array([0.0, 0.0, z - 0.03]), 0.025, 0.025, _THING)
    return Surfaces.joined([blocks(spans, _THING), legs])


def shelf(rng: np.random.Generator) -> Surfaces:
    """Generate a cupboard or a filled shelf with its back at y = 0, up to 2.1 m high."""
    x, y = 0.5 * rng.uniform(0.7, 1.3), rng.uniform(0.3, 0.45)
    levels = int(rng.integers(2, 6))
    height = levels * rng.uniform(0.35, 0.42)
    spans = [(-x, x, -0.02, 0.0, 0.0, height), (-x, 0.02 - x, -y, 0.0, 0.0, height)]
    spans += [(x - 0.02, x, -y, 0.0, 0.0, height)]
    for level in range(levels):
        z = height * level / levels
        fill = rng.uniform(0.3, 0.95)
        spans.append((-x, x, -y, 0.0, z, z + 0.02))
        spans.append((-x, x, -fill * y, 0.0, z + 0.02, z + rng.uniform(0.15, 0.32)))
    return blocks(spans, _THING)


def sofa(rng: np.random.Generator) -> Surfaces:
    """Generate a sofa or an armchair that faces -y."""
    x, seat, back = 0.5 * rng.uniform(0.8, 2.2), rng.uniform(0.38, 0.46), rng.uniform(0.75, 0.95)
    return blocks(
        [
            (-x, x, -0.45, 0.45, 0.0, seat),
            (-x, x, 0.25, 0.45, seat, back),
            (-x, 0.16 - x, -0.45, 0.45, seat, seat + 0.2),
            (x - 0.16, x, -0.45, 0.45, seat, seat + 0.2),
        ],
        _THING,
    )


def bench(rng: np.random.Generator) -> Surfaces:
    """Generate a bench along x, with or without a back."""
    x, seat = 0.5 * rng.uniform(1.3, 2.0), rng.uniform(0.42, 0.48)
    spans = [(-x, x, -0.22, 0.22, seat - 0.06, seat)]
    spans += [(end - 0.05, end + 0.05, -0.2, 0.2, 0.0, seat) for end in (0.2 - x, x - 0.2)]
    if rng.random() < 0.6:
        spans.append((-x, x, 0.19, 0.23, seat + 0.1, seat + 0.4))
    return blocks(spans, _THING)


def planter(rng: np.random.Generator) -> Surfaces:
    """Generate a tub with a round plant."""
    radius, height = rng.uniform(0.2, 0.45), rng.uniform(0.3, 0.6)
    crown = rng.uniform(0.7, 1.3) * radius
    tub = cones([[0.0, 0.0, 0.0]], [[0.0, 0.0, height]], 0.8 * radius, radius, _THING)
    plant = ellipsoids(
        [[0.0, 0.0, height + 0.7 * crown]], [[crown, crown, crown]], SurfaceClass.SHRUB, loss=0.4
    )
    return Surfaces.joined([tub, plant])


def bicycle(rng: np.random.Generator) -> Surfaces:
    """Generate a parked bicycle along x: two wheels, a frame and handlebars."""
    lean = rng.normal(0.0, 0.05)
    hubs = np.array([[-0.52, 0.0, 0.34], [0.52, 0.0, 0.34]])
    out = np.array([0.0, 0.015, 0.0])
    wheels = cones(hubs - out, hubs + out, 0.34, 0.34, _THING, loss=0.7)
    feet = [hubs[0], [-0.15, 0.0, 0.3], hubs[1], [-0.2, 0.0, 0.6]]
    heads = [[-0.2, lean, 0.6], [-0.25, lean, 0.95], [0.4, lean, 1.0], [0.4, lean, 0.8]]
    frame = cones(feet, heads, 0.025, 0.025, _THING)
    bars = cones([[0.4, lean - 0.28, 1.0]], [[0.4, lean + 0.28, 1.0]], 0.02, 0.02, _THING)
    return Surfaces.joined([wheels, frame, bars])


def rubbish_bins(rng: np.random.Generator) -> Surfaces:
    """Generate one or two rubbish bins."""
    return bins(rng, int(rng.integers(1, 3)))


def container(rng: np.random.Generator) -> Surfaces:
    """Generate one to three stacked containers of 6.06 m along x, 2.44 m wide and 2.59 m high."""
    count = int(rng.integers(1, 4))
    shifts = rng.normal(0.0, 0.03, (count, 2))
    centres = np.column_stack([shifts, 2.59 * (np.arange(count) + 0.5)])
    return boxes(centres, [3.03, 1.22, 1.295], SurfaceClass.BUILDING)
