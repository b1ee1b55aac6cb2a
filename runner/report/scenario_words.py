"""A scenario in words, and where a document's numbers come from; no path and no name of a machine is told."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any

from springline.model.base import COORDINATES
from springline.model.control import LAWS
from springline.model.hardware import ACTUATORS, SENSORS, Effect
from springline.model.parameters import Joint
from springline.runner.files import value_text
from springline.runner.report.document import Block, Heading, Source, Table
from springline.runner.report.scale import figure_text, quantity_text
from springline.runner.scenario import Scenario, portable_text
from springline.runner.version import __version__

Term = Mapping[str, float]


def shown_name(scenario: Scenario) -> str:
    """What a scenario is called: its packaged name, or that of its file."""
    source = PurePath(scenario.source)
    return source.name if source.is_absolute() or source.suffix else scenario.source


def described(scenario: Scenario) -> Table:
    """What a scenario is: arm, controller, hardware, base motion, reference and run, a row each."""
    document, system = scenario.document, scenario.system()
    joints = system.joints
    axes = ", ".join(f"{joint.name} ({joint.unit})" for joint in joints)
    rows = [("scenario", f"`{shown_name(scenario)}`"), ("arm", f"`{system.mechanism.name}`: {axes}")]
    rows += _row("other than the controller believes", _plant(document["plant"]))
    rows += _row("limits of its joints", _limits(scenario, joints))
    rows.append(("drive", _drive(scenario)))
    rows.append(("controller", _controller(scenario)))
    rows += _row("observer", "" if system.observer is None else system.observer.title)
    rows.append(("limits of the command", _command_limits(scenario, joints)))
    rows += _row("sensors", _sensors(scenario, joints))
    rows += _row("actuators", _actuators(scenario, joints))
    rows.append(("base motion", _base_motion(scenario)))
    rows.append(("reference", _signals(document["reference"], joints, "unit")))
    if system.forces:
        rows.append(("forces on the links", _signals(document["disturbance"], joints, "force")))
    rows.append(("start", _start(scenario, joints)))
    rows.append(("run", _run(scenario)))
    return Table(("", ""), rows, labels=2)


def provenance(scenario: Scenario, others: Sequence[tuple[str, str]] = ()) -> list[Block]:
    """Version, seed and hashes, then the whole scenario as it was resolved.

    others  further rows: what, and its value
    """
    names = _code_names(scenario)
    rows = [
        ("springline", __version__),
        ("scenario", f"`{shown_name(scenario)}`"),
        ("SHA-256 of the scenario below", f"`{scenario_hash(scenario)}`"),
        *((f"SHA-256 of the code `{names[user.reference]}`", f"`{user.hash}`") for user in scenario.code),
    ]
    if scenario.noisy:
        rows.append(("seed and run of the sensors' noise", f"{scenario.seed}, {scenario.run_number}"))
    return [
        Heading("Provenance"),
        Table(("", ""), [*rows, *others], labels=2),
        Source("The scenario with every default filled in", _resolved(scenario)),
    ]


def scenario_hash(scenario: Scenario) -> str:
    """SHA-256, as 64 hexadecimal digits, of a scenario with every default filled in; `provenance` shows both."""
    return hashlib.sha256(_resolved(scenario).encode()).hexdigest()


def _resolved(scenario: Scenario) -> str:
    """The whole scenario as TOML, its files by their names alone."""
    tables = {name: table["path"] for name, table in scenario.document.items() if "path" in table}
    paths = {name: path if path.startswith("springline:") else PurePath(path).name for name, path in tables.items()}
    return portable_text(scenario, paths, _code_names(scenario))


def _code_names(scenario: Scenario) -> dict[str, str]:
    """Reference to a user's class -> its file's name and its own."""
    return {user.reference: f"{PurePath(user.path).name}:{user.name}" for user in scenario.code}


def _row(name: str, text: str) -> list[tuple[str, str]]:
    return [(name, text)] if text else []


def _joined(values: Iterable[float], joints: Sequence[Joint], unit: str) -> str:
    """A number for each joint, once where all are the same; `unit` with {q} and {F} for the joint's."""
    pairs = zip(values, joints, strict=True)
    texts = [quantity_text(value, unit.format(q=joint.unit, F=joint.force)) for value, joint in pairs]
    return texts[0] if len(set(texts)) == 1 else " / ".join(texts)


def _plant(table: Mapping[str, Any]) -> str:
    """What the plant has of its own."""
    return ", ".join(
        f"{name} times {value_text(value['scale'])}" if isinstance(value, dict) else f"{name} = {value_text(value)}"
        for name, value in table.items()
    )


def _limits(scenario: Scenario, joints: Sequence[Joint]) -> str:
    pairs = zip(joints, scenario.limits, strict=False)
    return ", ".join(
        f"{joint.name} {quantity_text(low, joint.unit)} to {quantity_text(high, joint.unit)}"
        for joint, (low, high) in pairs
    )


def _drive(scenario: Scenario) -> str:
    structure = scenario.structure()
    kind = "a spring between each motor and its link" if structure.drive == "elastic" else "rigid"
    friction = ", ".join(name.replace("_", " ") for name in structure.friction)
    return f"{kind}; {friction}" if friction else kind


def _controller(scenario: Scenario) -> str:
    control, system = scenario.document["control"], scenario.system()
    parts = [system.controller.title]
    if system.controller.law is not None:
        parts.append(f"{LAWS[scenario.structure().law].title} law")
    if system.structure.drive == "elastic":
        parts.append("with fast control" if control["fast"] else "without fast control")
    if system.structure.feedforward != "none":
        parts.append("told how the base moves")
    period = quantity_text(control["period"], "s") if control["mode"] == "sampled" else ""
    return ", ".join([*parts, f"sampled every {period}" if period else "continuous"])


def _command_limits(scenario: Scenario, joints: Sequence[Joint]) -> str:
    control = scenario.document["control"]
    kinds = [("U_max", "{F}")] + ([("a_max", "{q}/s^2")] if scenario.system().controller.law else [])
    texts = []
    for name, unit in kinds:
        none = all(math.isinf(value) for value in control[name])
        texts.append(f"no {name}" if none else f"{name} = {_joined(control[name], joints, unit)}")
    return ", ".join(texts)


def _sensors(scenario: Scenario, joints: Sequence[Joint]) -> str:
    texts = _effects(SENSORS, scenario, joints)
    if scenario.structure().differenced:
        texts.append("rates made out of positions by differences")
    return ", ".join(texts)


def _actuators(scenario: Scenario, joints: Sequence[Joint]) -> str:
    delay = scenario.document["actuator"]["delay"]
    texts = [f"delay {quantity_text(delay, 's')}"] if delay else []
    return ", ".join([*texts, *_effects(ACTUATORS, scenario, joints)])


def _effects(known: Iterable[Effect], scenario: Scenario, joints: Sequence[Joint]) -> list[str]:
    """Those effects that a scenario has, with their numbers."""
    present = [effect for effect in known if effect.name in scenario.structure().effects]
    numbers = [_joined(scenario.document[e.table][e.name], joints, e.parameters[0].unit) for e in present]
    return [f"{effect.name.replace('_', ' ')} {text}" for effect, text in zip(present, numbers, strict=True)]


def _base_motion(scenario: Scenario) -> str:
    table = scenario.document["base_motion"]
    shape = scenario.structure().base_motion
    if shape.kind == "none":
        return "at rest"
    if shape.kind == "own":
        text = f"`{shape.own.partition('@')[0]}`"
    elif shape.kind == "table":
        text = f"the record `{PurePath(table['path']).name}`"
    else:
        moving = [(c, table[c.key]) for c in COORDINATES if table.get(c.key)]
        text = "; ".join(f"{c.key} {_sines(terms)} {c.unit}" for c, terms in moving) or "at rest"
    mount = ", ".join(figure_text(value) for value in table["mount"])
    return f"{text}; the arm stands at ({mount}) m" if any(table["mount"]) else text


def _signals(table: Mapping[str, Any], joints: Sequence[Joint], unit: str) -> str:
    """A signal per joint; `unit`: which of a joint's units it has."""
    if table["kind"] == "table":
        return f"the record `{PurePath(table['path']).name}`"
    if table["kind"] == "none":
        return "none"
    texts = []
    for joint in joints:
        own = table.get(joint.name, {})
        if "q" in own:
            points = zip(own["t"], own["q"], strict=True)
            way = ", ".join(f"{figure_text(q)} at {figure_text(t)} s" for t, q in points)
            texts.append(f"{joint.name} from point to point: {way} ({getattr(joint, unit)})")
            continue
        offset, sines = own.get("offset", 0.0), _sines(own.get("terms", ()))
        parts = ([figure_text(offset)] if offset or not sines else []) + ([sines] if sines else [])
        texts.append(f"{joint.name} {' + '.join(parts)} {getattr(joint, unit)}")
    return "; ".join(texts)


def _sines(terms: Sequence[Term]) -> str:
    return " + ".join(
        f"{_factor(t['amplitude'])}sin({_factor(t['omega'])}t{_phase(t.get('phase', 0.0))})" for t in terms
    )


def _factor(value: float) -> str:
    return "" if value == 1.0 else f"{figure_text(value)} "


def _phase(phase: float) -> str:
    return "" if not phase else f" {'−' if phase < 0 else '+'} {figure_text(abs(phase))}"


def _start(scenario: Scenario, joints: Sequence[Joint]) -> str:
    initial = scenario.document["initial"]
    if scenario.structure().start == "reference":
        return "on the reference"
    rates = initial["dq"]
    text = _joined(initial["q"], joints, "{q}")
    text += f" at {_joined(rates, joints, '{q}/s')}" if any(rates) else ", at rest"
    motor = initial.get("q_motor", "unloaded")
    springs = {"unloaded": "springs unloaded", "equilibrium": "springs that carry the weight"}
    if scenario.structure().drive == "rigid":
        return text
    return f"{text}, {springs[motor] if isinstance(motor, str) else 'motors at ' + _joined(motor, joints, '{q}')}"


def _run(scenario: Scenario) -> str:
    simulation = scenario.document["simulation"]
    length, step = (quantity_text(value, "s") for value in (simulation["duration"], scenario.step))
    every = f", a row every {scenario.output_every} steps" if scenario.output_every > 1 else ""
    return f"{length} in {scenario.steps} steps of {step}, {scenario.integrator}{every}"
