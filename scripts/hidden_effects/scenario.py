"""One person's session before it is measured: what effects and aliens change, and what they report of themselves."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable

from .laboratory import Laboratory
from .person import Person, Trials, draw_person, draw_trials
from .plant import Force, eq2, gamma_reflex, linear_interface
from .ramp import AMPLITUDE_RAD, Ramp, Servo

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

    def as_json(self):
        parameters = {
            k: {"value": v, "nominal": k in self.nominal} for k, v in self.parameters.items()
        }
        return {"mechanism": self.mechanism, "class": self.kind, "size": self.size, "parameters": parameters,
                "note": self.note}


@dataclass
class Scenario:
    seed: int
    laboratory: Laboratory
    person: Person
    trials: Trials
    ramp: Ramp
    servo: Servo
    lever: dict
    forces: list[Force]
    elastic: Callable = eq2
    interface: Callable = linear_interface
    torque_chain: list[Callable] = field(default_factory=list)  # (t, torque, scenario, motion) -> torque
    digital_chain: list[Callable] = field(default_factory=list)  # (t, torque, scenario) -> torque, after sampling
    record_command: bool = False
    angle_factor: float = 1.0  # recorded over true


def base_scenario(seed: int, laboratory: Laboratory) -> Scenario:
    person = draw_person(seed)
    person.tremor *= laboratory.tremor
    person.gauge_noise_nm *= laboratory.gauge_noise
    trials = draw_trials(seed, person, laboratory)
    late = person.late_reflex
    return Scenario(
        seed=seed,
        laboratory=laboratory,
        person=person,
        trials=trials,
        ramp=Ramp(trials.velocity_rad_s.copy(), AMPLITUDE_RAD, person.ramp_rise_s),
        servo=Servo(person.servo_bandwidth_hz, 1000.0),
        lever=laboratory.own_lever(),
        forces=[gamma_reflex(late["gain_nm_s_per_rad"], late["latency_s"], late["time_constant_s"])],
    )
