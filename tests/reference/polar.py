"""Polar cells point by point, from the definition."""

import math


def edges(max_range, first_width, growth):
    """Ranges between bins: widths multiply by `growth`, and the last bin ends at `max_range`."""
    ranges = [0.0]
    width = first_width
    while ranges[-1] + width < max_range * (1 - 1e-9):
        ranges.append(ranges[-1] + width)
        width *= growth
    return [*ranges, max_range]


def cell(x, y, sectors, ranges):
    """The cell of one point: the bin whose half-open range and the sector whose arc holds it."""
    distance = math.sqrt(x * x + y * y)
    bins = len(ranges) - 1
    for b in range(bins):
        if ranges[b] <= distance < ranges[b + 1]:
            return sector(x, y, sectors) * bins + b
    return -1


def sector(x, y, sectors):
    """The arc that holds the azimuth, counted in turns in [0, 1) from x towards y."""
    turns = math.atan2(y, x) / (2 * math.pi)
    arc = math.floor(turns * sectors)
    return arc + sectors if arc < 0 else arc


def distance_to_sector_edge(x, y, sectors):
    """How far the azimuth is from the nearest edge between sectors, in sectors."""
    place = math.atan2(y, x) / (2 * math.pi) * sectors
    return abs(place - round(place))
