"""Kinds of plain silos that are seen badly: by sensors, cameras, views that are hard."""

from __future__ import annotations

from collections.abc import Callable

from .cameras import Intrinsics
from .drawing import Draw, Plan, View
from .scenes import Vessel
from .sensors import ASTRA_S, AZURE, D455, Faults, Sensor
from .walls import Wall


def sensor_of(sensor: Sensor) -> Callable[[Draw], Plan]:
    """A control through another sensor."""

    def plan(d: Draw) -> Plan:
        vessel = d.silo(radius=d.log(0.8, 2.6))
        return Plan(vessel, d.feed(vessel), sensor=sensor)

    plan.__doc__ = f"A control through {sensor.profile}."
    return plan


def multipath(d: Draw) -> Plan:
    """A time-of-flight sensor whose light goes round: 1 to 3 % of the depth."""
    vessel = d.silo(radius=d.log(0.8, 2.6))
    return Plan(vessel, d.feed(vessel), sensor=AZURE, faults=Faults(multipath=d.between(0.01, 0.03)))


def stereo_warp(d: Draw) -> Plan:
    """A lasting warp in disparity of 0.1 to 0.5 % at 2 m."""
    vessel = d.silo()
    faults = Faults(warp=d.between(0.001, 0.005), warp_length=d.between(0.1, 0.3))
    return Plan(vessel, d.feed(vessel), faults=faults, sensor=ASTRA_S if d.chance(0.5) else D455)


def _wrong(d: Draw, off: Intrinsics, **more: object) -> Plan:
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel), off=off, **more)  # type: ignore[arg-type]


def centre_off(d: Draw) -> Plan:
    """The principal point is off by 0.5 to 4 px of a frame 640 wide."""
    return _wrong(d, Intrinsics(0, 0, 0.0, 0.0, *d.around(d.log(0.5, 4.0))))


def centre_far_off(d: Draw) -> Plan:
    """The principal point is off by 6 to 13 px of a frame 640 wide."""
    return _wrong(d, Intrinsics(0, 0, 0.0, 0.0, *d.around(d.between(6.0, 13.0))))


def focal_off(d: Draw) -> Plan:
    """Both focal lengths are off by 1 to 2 %."""
    off = d.sign() * d.between(0.01, 0.02)
    return _wrong(d, Intrinsics(0, 0, off, off, 0.0, 0.0))


def focal_x_off(d: Draw) -> Plan:
    """One focal length is off by 1 to 2 %."""
    return _wrong(d, Intrinsics(0, 0, d.sign() * d.between(0.01, 0.02), 0.0, 0.0, 0.0))


def distortion(d: Draw) -> Plan:
    """Radial distortion that nobody declared."""
    return _wrong(d, Intrinsics(0, 0, 0.0, 0.0, 0.0, 0.0, d.sign() * d.log(0.015, 0.1)))


def aligned(d: Draw) -> Plan:
    """Depth aligned to colour, told with the depth camera's intrinsics."""
    off = Intrinsics(
        0, 0, d.between(-0.015, 0.015), d.between(-0.015, 0.015), *d.around(d.between(0.5, 3.0)), d.between(0.0, 0.05)
    )
    return _wrong(d, off, faults=Faults(dropout=d.between(0.02, 0.1), flying=0.5))


def dust(d: Draw) -> Plan:
    """10 to 40 % of the pixels read a grain of dust."""
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel), faults=Faults(dust=d.between(0.1, 0.4), dropout=d.between(0.0, 0.1)))


def invalid(d: Draw) -> Plan:
    """60 to 97 % of the pixels have no reading."""
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel), faults=Faults(dropout=d.between(0.6, 0.97)))


def narrow(d: Draw) -> Plan:
    """Bare wall on 75 to 90 degrees of the circle."""
    vessel = d.silo()
    view = View(wall=(0.5, 1.0), arc=(75.0, 90.0), tilt=(25.0, 65.0), aside=(0.3, 1.0))
    return Plan(vessel, d.feed(vessel, 0.9), view=view)


def tilted(d: Draw) -> Plan:
    """The camera looks 45 to 80 degrees off the vertical."""
    vessel = d.silo()
    return Plan(vessel, d.feed(vessel, 0.7), view=View(tilt=(45.0, 80.0), wall=(0.3, 1.0)))


def horizon(d: Draw) -> Plan:
    """The camera looks above the horizon, at the wall."""
    radius, _, rim = d.shell(tall=(1.5, 3.0))
    vessel = Vessel(Wall(radius), d.cone(radius, rim), -8.0)
    return Plan(vessel, view=View(tilt=(95.0, 130.0), wall=(0.3, 1.0)))


def tall(d: Draw) -> Plan:
    """A slender silo, as deep as the sensor sees."""
    radius, top, rim = d.shell(d.between(0.8, 1.2), tall=(5.0, 7.0))
    vessel = Vessel(Wall(radius), d.cone(radius, rim), top)
    return Plan(vessel, d.feed(vessel, 0.8))


def large(d: Draw) -> Plan:
    """A radius of 3 to 6 m, wall at the end of the sensor's range."""
    vessel = d.silo(radius=d.between(3.0, 6.0))
    return Plan(
        vessel, d.feed(vessel, 0.5), view=View(wall=(0.25, 1.0), tilt=(20.0, 65.0), aside=(0.1, 0.95), valid=0.3)
    )
