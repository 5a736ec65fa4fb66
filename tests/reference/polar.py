"""Polar cells by their definition, point by point."""

import math


def edges(max_range, first_width, growth):
    """Edges of bins whose widths grow by a factor; the last edge is `max_range`."""
    ranges = [0.0]
    width = first_width
    while ranges[-1] + width < max_range * (1 - 1e-9):
        ranges.append(ranges[-1] + width)
        width *= growth
    return [*ranges, max_range]


def cell(x, y, sectors, ranges):
    """Cell of a point: its half-open range bin in its sector."""
    distance = math.sqrt(x * x + y * y)
    bins = len(ranges) - 1
    for b in range(bins):
        if ranges[b] <= distance < ranges[b + 1]:
            return sector(x, y, sectors) * bins + b
    return -1


def sector(x, y, sectors):
    """Sector that contains the azimuth, counted from x towards y."""
    turns = math.atan2(y, x) / (2 * math.pi)
    arc = math.floor(turns * sectors)
    return arc + sectors if arc < 0 else arc


def distance_to_sector_edge(x, y, sectors):
    """Distance of the azimuth from the nearest edge between sectors, in sectors."""
    position = math.atan2(y, x) / (2 * math.pi) * sectors
    return abs(position - round(position))
