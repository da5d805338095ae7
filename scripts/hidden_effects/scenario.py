"""One person's session before it is measured: what effects and aliens change, and what they report of themselves."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable

from .laboratories import Laboratory
from .person import Person, Trials, draw_person, draw_trials
from .plant import Force, eq2, gamma_reflex, linear_interface
from .ramp import Ramp, Servo

SIZES = json.loads((Path(__file__).parent / "sizes.json").read_text())


@dataclass
class Hidden:
    """The truth of one effect. `nominal` names the parameters whose form has no exact counterpart."""

    mechanism: str
    kind: str  # plant, rig, sensor, trial or alien
    size: float
    parameters: dict
    nominal: list = field(default_factory=list)
    note: str = ""
    law: str | None = None
    place: str | None = None  # of an alien that is a plain function of one argument at one place
    argument: str | None = None

    def as_json(self):
        parameters = {
            k: {"value": v, "nominal": k in self.nominal} for k, v in self.parameters.items()
        }
        found_by = {k: v for k in ("law", "place", "argument") if (v := getattr(self, k)) is not None}
        return {"mechanism": self.mechanism, "class": self.kind, "size": self.size, "parameters": parameters,
                "note": self.note, **found_by}


@dataclass
class Scenario:
    seed: int
    laboratory: Laboratory
    person: Person
    trials: Trials
    ramp: Ramp
    servo: Servo
    lever: dict | None
    forces: list[Force]
    elastic: Callable = eq2
    interface: Callable = linear_interface
    torque_chain: list[Callable] = field(default_factory=list)  # (t, torque, scenario, motion) -> torque
    digital_chain: list[Callable] = field(default_factory=list)  # (t, torque, scenario) -> torque, after sampling
    angle_chain: list[Callable] = field(default_factory=list)  # (t, angle, scenario) -> angle
    followed: Callable | None = None  # what the servo follows where it is not the ramp itself
    record_command: bool = False
    angle_factor: float = 1.0  # recorded over true; a number, or a column with an entry per trial


def base_scenario(seed: int, laboratory: Laboratory) -> Scenario:
    person = draw_person(seed)
    person.tremor *= laboratory.tremor
    person.tremor_hz *= laboratory.tremor_frequency
    person.gauge_noise_nm *= laboratory.gauge_noise
    trials = draw_trials(seed, person, laboratory)
    late = person.late_reflex
    return Scenario(
        seed=seed,
        laboratory=laboratory,
        person=person,
        trials=trials,
        ramp=Ramp(trials.velocity_rad_s.copy(), laboratory.amplitude_rad, person.ramp_rise_s * laboratory.ramp_rise_factor,
                  laboratory.ramp_profile),
        servo=Servo(person.servo_bandwidth_hz * laboratory.servo_bandwidth_factor, 1000.0),
        lever=laboratory.own_lever(),
        forces=[gamma_reflex(late["gain_nm_s_per_rad"], late["latency_s"], late["time_constant_s"])],
    )
