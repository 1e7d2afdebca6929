"""Models of the vehicles of a fleet file, and the limits of their arbiters."""

import math
from dataclasses import replace
from typing import Final

from rcopterx.fleet.reading import dataclass_from, merged, replaced
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_types import battery_limits, type_of
from rcopterx.radios.battery import BatteryLimits
from rcopterx.radios.limits import ArbiterLimits, Fence, LandingLimits, StandingLimits, SurveillanceLimits
from rcopterx.vehicles.lift_off import LiftOffLimits
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_THRUST


def model_of(fleet: FleetFile, name: str) -> Model:
    """Return the model of a vehicle: type, parameters of the file, bounds by the volume; or `FleetError`."""
    model = replaced(_with_full_sticks(fleet, name), fleet.vehicles[name].model, f"vehicles.{name}.model")
    # Set points stay within the volume, which may begin above the floor; flights begin and end on the floor.
    (low_x, low_y, low_z), high = fleet.volume.min_m, fleet.volume.max_m
    return model.within((low_x, low_y, min(low_z, 0.0)), high)


def learning_models(fleet: FleetFile) -> dict[str, Model]:
    """Return the models of the vehicles that learn: those that were not identified, unless forbidden."""
    wanted = not fleet.clock.lockstep if fleet.learning is None else fleet.learning
    names = [name for name, vehicle in fleet.vehicles.items() if wanted and vehicle.learning]
    models = {name: model_of(fleet, name) for name in names}
    return {name: one for name, one in models.items() if not one.uncertainty.axes[0].identified}


def _with_full_sticks(fleet: FleetFile, name: str) -> Model:
    """Return the model of a vehicle's type with the gains that follow from settings of the radio."""
    own, transmitter = type_of(fleet, name), fleet.vehicles[name].transmitter
    usual, table = own.file.transmitter, transmitter.settings
    other_protocol = transmitter.protocol not in (None, usual.protocol)
    if other_protocol or not table.keys() & {"full_tilt_deg", "full_yaw_rate_deg_s"}:
        return own.model
    from rcopterx.radios.registry import settings_class  # not in agents of vehicles without such settings

    kind, where = settings_class(usual.protocol), f"vehicles.{name}.transmitter.settings"
    before, after = (dataclass_from(kind, one, where) for one in (usual.settings, usual.settings | table))
    tilt = math.tan(math.radians(after.full_tilt_deg)) / math.tan(math.radians(before.full_tilt_deg))
    pitch, roll, thrust, yaw = own.model.input_gain
    yaw *= after.full_yaw_rate_deg_s / before.full_yaw_rate_deg_s
    return replace(own.model, input_gain=(tilt * pitch, tilt * roll, thrust, yaw))


SLOWER: Final = 2.0  # a landing from the volume's ceiling may take so many times the speed's time
SLOWEST_YAW_PER_S: Final = 1.0  # yaw damping assumed for vehicles with less


def limits_of(fleet: FleetFile, name: str) -> ArbiterLimits:
    """Return the limits that the transmitter gateway enforces for a vehicle."""
    own = type_of(fleet, name).file
    ceiling_m = fleet.volume.max_m[2]
    if ceiling_m < own.lowest_ceiling_m:
        raise FleetError(
            f"volume.max_m[2]: {ceiling_m:g} m is too low for {name}: its type takes off to "
            f"{own.lowest_ceiling_m:g} m"
        )
    model = model_of(fleet, name)
    # A volume may begin above the floor, but every flight begins and ends on it.
    x, y, lowest_m = fleet.volume.min_m
    floor_m = min(lowest_m, 0.0)
    fence = Fence((x, y, floor_m), fleet.volume.max_m) if fleet.safety.geofence else None
    base = ArbiterLimits(
        lower=model.input_min,
        upper=model.input_max,
        floor_m=floor_m,
        landing=landing_of(model),
        lift_off=LiftOffLimits(float(model.hover_input[U_THRUST]), max(model.lag_s[U_THRUST], 0.01)),
        surveillance=SurveillanceLimits(fence=fence, trust_repeated_poses=False),
        standing=StandingLimits(),
    )
    table = merged(own.safety, fleet.safety.settings)
    limits = replaced(base, table, "safety.settings")
    if "longest_s" in table.get("landing", {}):
        return limits
    law = limits.landing
    descent_s = SLOWER * (ceiling_m - floor_m) / law.descent_m_s
    law = replace(law, longest_s=max(law.longest_s, law.braking_s + descent_s))
    return replace(limits, landing=law)


def battery_of(fleet: FleetFile, name: str) -> BatteryLimits:
    """Return the voltages that limit the flights of a vehicle; `FleetError` if they contradict each other."""
    own = fleet.vehicles[name].battery
    return battery_limits(own, f"vehicles.{name}.battery", type_of(fleet, name).file.battery)


def longest_shutdown_s(fleet: FleetFile, host: str) -> float:
    """Return the longest time in which the gateways of a host bring their vehicles down."""
    return max((limits_of(fleet, one).longest_shutdown_s for one in fleet.transmitters_on(host)), default=0.0)


def landing_of(model: Model) -> LandingLimits:
    """Return the parameters of the landing law for a nominal model."""
    pitch, roll, thrust, yaw = model.input_gain
    return LandingLimits(
        input_gain=(pitch, roll, thrust), yaw_rate_gain_rad_s=yaw / max(-model.damping[3], SLOWEST_YAW_PER_S)
    )
