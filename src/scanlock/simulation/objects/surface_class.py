"""Classes of simulated surfaces."""

import enum


class SurfaceClass(enum.IntEnum):
    """Class of a surface and of the points on it."""

    GROUND = 0
    BUILDING = 1
    CAR = 2
    POLE = 3
    TRUNK = 4
    FOLIAGE = 5
    SHRUB = 6
    GRASS = 7
    KERB = 8
    FENCE = 9
    GAZEBO = 10
    PERSON = 11
    ROCK = 12
    FURNITURE = 13
