"""Scenarios: a TOML file, checked as a whole, then everything the model and the loop want to know of it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.codegen.kernel import BANDS, lanes
from springline.codegen.numbers import doubles
from springline.codegen.program import program
from springline.model.base import COORDINATES, shortest
from springline.model.base_motion import MOTIONS, moving_terms
from springline.model.control import CONTROLLERS, INPUT, LAWS, OBSERVERS, LogForm, ObserverInput, SurfaceExponents
from springline.model.drive import DRIVES, FRICTION, DriveKind
from springline.model.hardware import ACTUATORS, EFFECTS, SENSORS
from springline.model.mechanisms import MECHANISMS, Implausible
from springline.model.structure import Feedforward, MotorStart, SignalKind, SignalShape, Structure
from springline.model.system import System, system_of
from springline.runner.files import InputError, Problem, document_text, read_toml, shortened, unknown
from springline.runner.scenario import schema
from springline.runner.scenario.checking import Document, resolve, size_given
from springline.runner.scenario.control_tables import CHOOSERS, table_of
from springline.runner.scenario.dotted import (
    canonical_key,
    expect_keys,
    flat,
    plain,
    replaced,
    respelled,
    respellings,
    scale_key,
)
from springline.runner.scenario.locate import expect_kind, read_scenario, relative_path
from springline.runner.scenario.numeric_keys import NumericKey, first_outside, numeric_keys
from springline.runner.scenario.splines import Spline
from springline.runner.scenario.user_code import UserClass, canonical_reference, load_class, read_class, told

Floats = NDArray[np.float64]
_ARM = ("mechanism", "drive", "plant", "initial", "reference")
_RUNS_AT_ONCE = 4096

Slots = dict[str, float | Floats]
"""Slot key -> one number for all runs, or a column (runs,) of them."""


@dataclass(frozen=True, eq=False, repr=False)
class Scenario:
    """A scenario with every default filled in; immutable.

    Two are equal if their documents and the contents of their signal tables are, wherever the files of these lie.

    source         the file or packaged name it was loaded from
    folder         what relative paths in overrides count from: the working directory, or the folder of the sweep
    document       its tables as plain data; read it, do not change it
    signal_tables  its signals from CSV files, in the order of System.tables
    notes          what was made of the CSV files, a sentence each, for people
    code           classes of users' files that it names
    """

    source: str
    folder: Path
    document: Document
    signal_tables: tuple[Spline, ...]
    notes: tuple[str, ...] = ()
    code: tuple[UserClass, ...] = ()

    def __repr__(self) -> str:
        return f"Scenario({self.source!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    @cached_property
    def _identity(self) -> tuple[str, tuple[Spline, ...]]:
        return document_text(_with_paths(self.document, lambda path: "", self.registered)), self.signal_tables

    # What the loop is told

    @property
    def step(self) -> float:
        """Step of the integrator, s."""
        return float(self._simulation["step"])

    @property
    def steps(self) -> int:
        """Number of steps of a complete run."""
        return round(float(self._simulation["duration"]) / self.step)

    @property
    def control_every(self) -> int:
        """Steps per sample of the control; 0 means continuous."""
        control = self.document["control"]
        return round(control["period"] / self.step) if control["mode"] == "sampled" else 0

    @property
    def integrator(self) -> str:
        """Name of the integrator."""
        return str(self._simulation["integrator"])

    @property
    def output_every(self) -> int:
        """Steps per row of the trajectory."""
        return int(self._simulation["output_every"])

    @property
    def bound(self) -> float:
        """Largest |x_i| before a run is stopped, SI units."""
        return float(self._simulation["bound"])

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """Least and greatest coordinate of each joint before a run is stopped; () where there are none."""
        pairs = tuple((float(low), float(high)) for low, high in self.document["mechanism"].get("limits", ()))
        return pairs if any(math.isfinite(value) for pair in pairs for value in pair) else ()

    @property
    def response_band(self) -> float:
        """Fraction of |e_i(0)| that defines the response time; 0 where an absolute error does."""
        return float(self._simulation.get("response_band", 0.0))

    @property
    def settling_band(self) -> float:
        """Fraction of |e_i(0)| that defines the settling time; 0 where an absolute error does."""
        return float(self._simulation.get("settling_band", 0.0))

    @property
    def response_error(self) -> float:
        """|e_i| that defines the response time, SI; 0 where the band does."""
        return float(self._simulation.get("response_error", 0.0))

    @property
    def settling_error(self) -> float:
        """|e_i| that defines the settling time, SI; 0 where the band does."""
        return float(self._simulation.get("settling_error", 0.0))

    @property
    def sigma_amplitude(self) -> float:
        """Amplitude of sigma at which the reaching law counts as a gain, SI."""
        return float(self.document["analysis"]["sigma_amplitude"])

    @property
    def seed(self) -> int:
        """What the noise of sensors is drawn with."""
        return int(self.document["sensor"]["seed"])

    @property
    def run_number(self) -> int:
        """The number of the run that the noise goes by: 0, or which run of a batch it is."""
        return int(self.document["sensor"]["run"])

    @property
    def noisy(self) -> bool:
        """Whether sensors are noisy."""
        return any(EFFECTS[name].noisy for name in self.structure().effects)

    @property
    def _simulation(self) -> dict[str, Any]:
        return self.document["simulation"]

    # What the model is told

    def registered(self, name: str) -> str:
        """What a mechanism, controller, law or base motion that the document names is registered as."""
        return next((user.key for user in self.code if user.reference == name), name)

    @property
    def control_tables(self) -> frozenset[str]:
        """Names of the tables [control.<name>] that it has: of its controller, its observer, a law of one's own."""
        chosen = {key: self.registered(self.document["control"][key.partition(".")[2]]) for key in CHOOSERS}
        return frozenset(table for key, name in chosen.items() if (table := table_of(key, name)))

    def structure(self) -> Structure:
        """Everything about the scenario that is no number."""
        control, initial = self.document["control"], self.document["initial"]
        motor = initial.get("q_motor", "unloaded")
        mechanism = self.registered(self.document["mechanism"]["name"])
        size = size_given(mechanism, self.document["mechanism"])
        joints = [joint.name for joint in MECHANISMS[mechanism].of_size(size).joints]
        disturbance = _shape(self.document["disturbance"], joints)
        return Structure(
            mechanism=mechanism,
            law=self.registered(control["law"]),
            controller=self.registered(control["controller"]),
            observer=self.registered(control["observer"]),
            observer_input=cast(ObserverInput, self._observer_input),
            feedforward=cast(Feedforward, control["feedforward"]),
            log_form=cast(LogForm, control["log_form"]),
            exponents=SurfaceExponents(**{name: control[name] for name in ("l", "m", "p", "r")}),
            reference=_shape(self.document["reference"], joints),
            base_motion=self._base_motion(),
            mount=any(self.document["base_motion"]["mount"]),
            mount_rpy=any(self.document["base_motion"]["mount_rpy"]),
            initial_motor=cast(MotorStart, motor if isinstance(motor, str) else "given"),
            drive=cast(DriveKind, self.document["drive"]["kind"]),
            start="reference" if initial.get("on_reference") else "given",
            integrator=self.integrator,
            size=size,
            disturbance=disturbance if disturbance.kind != "none" else SignalShape(),
            friction=tuple(item.name for item in FRICTION if self._has(item.name)),
            effects=tuple(
                effect.name
                for effect in (*SENSORS, *ACTUATORS)
                if any(value != effect.absent for value in self.document[effect.table].get(effect.name, ()))
            ),
            delay=round(self.document["actuator"]["delay"] / self.step),
            differenced=self.document["sensor"]["velocity"] == "differenced",
        )

    def _has(self, name: str) -> bool:
        """Whether a damping or friction is not zero, in the plant or in what the controller believes of it."""
        given = (self.document["drive"].get(name), self.document["plant"].get(name))
        return any(number for value in given for _, number in flat(value) if not isinstance(value, dict))

    @property
    def _observer_input(self) -> str:
        """What drives the observer; what there is no choice of is the first of its inputs."""
        observer = OBSERVERS[self.registered(self.document["control"]["observer"])]
        return str(self.document["control"].get(observer.name, {}).get(INPUT, observer.inputs[0]))

    def _base_motion(self) -> SignalShape:
        table = self.document["base_motion"]
        own = self.registered(table["kind"])
        if own in MOTIONS:
            return SignalShape("own", shortest(moving_terms(MOTIONS[own])), own)
        shape = _shape(table, [c.key for c in COORDINATES])
        return replace(shape, terms=shortest(shape.terms))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the theory of its controller does not cover, a sentence each, for people."""
        return self.system().unmet(self.values())

    def system(self) -> System:
        """The System of the structure; the same object for equal structures."""
        return system_of(self.structure())

    def tables(self) -> list[Spline]:
        """The signal tables, in the order of System.tables."""
        return list(self.signal_tables)

    def values(self) -> Floats:
        """The parameter vector p, in the order of System.slots."""
        return np.array([self._slot(slot.key, self._numbers) for slot in self.system().slots], dtype=np.float64)

    def value_of(self, key: str) -> object:
        """The value of a dotted key: of a slot of p as the run uses it ("plant.m3"), else of the document.

        Raises InputError if there is no such key.
        """
        name = canonical_key(key)
        try:
            return self._slot(name, self._numbers)
        except KeyError:
            entries = dict(flat(self.document))
        if name not in entries:
            raise InputError(unknown(self.source, key, "key", key, [*entries, *self.numeric_keys()]))
        return entries[name]

    def number_of(self, key: str) -> float:
        """The value of a dotted key that has one number, as `value_of`.

        Raises InputError if there is no such key, TypeError if its value is no number.
        """
        value = self.value_of(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise TypeError(f"{key} is {value!r}, expected a number")
        return float(value)

    def numeric_keys(self) -> dict[str, NumericKey]:
        """Every number that may vary within the structure, by dotted key."""
        return dict(numeric_keys(self.system()))

    def values_for(self, columns: Mapping[str, ArrayLike]) -> Floats:
        """One parameter vector a run, (runs, slots), with `columns` as for `slots_for`; one run if there are none."""
        slots = self.slots_for(columns)
        return per_run(slots, list(slots), max(np.size(values) for values in slots.values()))

    def columns_for(self, columns: Mapping[str, ArrayLike]) -> dict[str, Floats]:
        """Columns of numbers, one a run, by numeric key: each as a native float64 array of one dimension.

        Raises InputError for an unknown key, what is no column of numbers, a number that would not stay what it is, and
        one that is out of bounds.
        """
        keys, problems = numeric_keys(self.system()), []
        result = {}
        for name, values in columns.items():
            if name not in keys:
                problems.append(unknown(self.source, name, "numeric key", name, keys))
                continue
            try:
                column = np.atleast_1d(doubles(values))
            except (TypeError, ValueError) as error:
                problems.append(Problem(self.source, name, f"expected a column of numbers ({error})"))
                continue
            if column.ndim != 1:
                text = "expected a column of numbers, one for each run"
                problems.append(Problem(self.source, name, text, f"shape {column.shape}"))
                continue
            outside = first_outside(keys[name].bounds, column)
            if outside is not None:
                text = f"run {outside}: expected {schema.number_text(keys[name].bounds, keys[name].unit)}"
                problems.append(Problem(self.source, name, text, schema.given_text(float(column[outside]))))
            result[name] = column
        problems += schema.excluded_bands(columns, self.source)
        if problems:
            raise InputError(*problems)
        return result

    def bands_for(self, columns: Mapping[str, ArrayLike]) -> Floats | None:
        """What the metrics of each run take for settled, (runs, len(BANDS)); None where it is the scenario's in all.

        columns  as for `slots_for`, which raises InputError for them
        An error that varies takes the place of the scenario's band, and a band that of its error.
        """
        given = self._numbers
        checked = {name: values for name, values in self.columns_for(columns).items() if name in schema.EXCLUDED_BY}
        if not checked:
            return None
        dropped = {schema.EXCLUDED_BY[name] for name in checked}
        result = np.empty((len(next(iter(checked.values()))), len(BANDS)))
        for column, name in zip(result.T, BANDS, strict=True):
            key = f"simulation.{name}"
            column[:] = checked.get(key, 0.0 if key in dropped else given.get(key, 0.0))
        return result

    def slots_for(self, columns: Mapping[str, ArrayLike]) -> Slots:
        """What each slot is, in the order of System.slots: `columns` as for `columns_for`, all of one length.

        Where two keys set the same entry, the later one counts. Raises InputError.
        """
        keys = numeric_keys(self.system())
        numbers: dict[str, float | Floats] = dict(self._numbers)
        checked = self.columns_for(columns)
        runs = len(next(iter(checked.values()), ()))
        text = "expected a column of numbers, one for each run, as long as the others"
        other = [(name, len(column)) for name, column in checked.items() if len(column) != runs]
        if other:
            raise InputError(*(Problem(self.source, name, text, f"{count} numbers") for name, count in other))
        for name, column in checked.items():
            for leaf in keys[name].leaves:
                if leaf.startswith("plant."):  # a value and a factor exclude each other
                    numbers.pop(leaf.replace(".scale", "") if ".scale" in leaf else scale_key(leaf), None)
                numbers[leaf] = column
        return {slot.key: self._slot(slot.key, numbers) for slot in self.system().slots}

    @cached_property
    def _numbers(self) -> dict[str, float]:
        """The document's floats by dotted key."""
        return {key: value for key, value in flat(self.document) if isinstance(value, float)}

    def _slot(self, key: str, numbers: Mapping[str, Any]) -> Any:
        """The value (or column of values) of one slot; KeyError if it is no slot of this scenario."""
        table, _, name = key.partition(".")
        if table == "plant" and key not in numbers:
            nominal = next((f"{t}.{name}" for t in ("mechanism", "drive") if f"{t}.{name}" in numbers), key)
            return numbers[nominal] * numbers.get(scale_key(key), 1.0)
        if name.startswith("K_f.") and not self.document["control"]["fast"]:
            return 0.0 * numbers[key]
        if table == "initial" and key not in numbers:
            return 0.0  # not read: the structure says how the run starts
        return numbers[key]

    # Changed and written

    def including(self, values: Mapping[str, ArrayLike]) -> Scenario:
        """This scenario, with damping, friction, and effects of sensors and motors that `values` (key -> numbers) have.

        What is zero, or a limit at infinity, is no number of the structure, and so none that could vary: it becomes the
        largest finite of its numbers. Raises InputError.
        """
        present = (*self.structure().friction, *self.structure().effects)
        added: dict[str, float] = {}
        for key, numbers in values.items():
            if absent_at(key) is not None and key.split(".")[1] not in present:
                try:
                    column = np.ravel(doubles(numbers))
                except (TypeError, ValueError):  # `columns_for` says what is wrong
                    continue
                positive = column[np.isfinite(column) & (column > 0.0)]
                added |= {key: float(positive.max())} if positive.size else {}
        return self.with_overrides(added)

    def with_overrides(self, overrides: Mapping[str, object], *, read: bool = True) -> Scenario:
        """This scenario with other values at some dotted keys ("control.mu.0", "plant.m3.scale", …).

        A new kind of reference, base motion or disturbance, another control mode or mechanism drops what belonged to
        the old one. Paths count from `folder`. What is going to be changed once more need not `read` its signal files.
        Raises TypeError for what is no mapping of texts, InputError for whatever a file may not hold either.
        """
        expect_keys(overrides, "overrides such as {'control.delta': 0.02}")
        if not overrides:
            return self
        where = _overridden(self.source)
        given = respellings(overrides)
        overrides = self._canonical(overrides, where)
        document = self._without_excluded(overrides)
        problems = []
        joints = self._joints_with(overrides, where)
        late = [key for key in overrides if self._follows_nominal(key) and key.rpartition(".")[0] not in overrides]
        for key, value in sorted(overrides.items(), key=lambda item: item[0] in late):
            try:
                if key in late:
                    _give_plant_its_own(document, key, joints)
                document = replaced(document, key.split("."), plain(value), joints)
            except LookupError as error:
                problems.append(Problem(where, key, f"there is no such entry: {error.args[0]}"))
            except (TypeError, ValueError) as error:
                problems.append(Problem(where, key, f"expected a value that TOML can hold: {error}"))
        if problems:
            raise InputError(*problems)
        try:
            resolved = resolve(document, where, self.folder, read=read)
        except InputError as error:
            renamed = (replace(problem, key=respelled(problem.key, given)) for problem in error.problems)
            raise InputError(*renamed) from error
        changed = Scenario(self.source, self.folder, *resolved)
        if read:
            changed.expect_computable(where)
        return changed

    def _follows_nominal(self, key: str) -> bool:
        """Whether a key is one joint's of a plant's value that is the controller's as long as nothing else is said."""
        table, *path = key.split(".")
        return table == "plant" and len(path) > 1 and path[-1].isdecimal() and path[0] not in self.document["plant"]

    def expect_computable(self, where: str) -> None:
        """Build what users' classes describe, so that what is wrong with them is told before anything else is done.

        where  what the scenario came from, for messages
        Raises InputError.
        """
        if not self.code and MECHANISMS[self.structure().mechanism].regular:
            return
        keys = {
            user: f"{table}.{key}"
            for user in self.code
            for table, key in schema.DOORS
            if self.document[table][key] == user.reference
        }
        with told(keys, where):
            if keys:
                _expect_printable(self.structure())
        user = next((user for user, key in keys.items() if key == "mechanism.name"), None)
        self._expect_bodies(where, "mechanism" if user is None else "mechanism.name", f"{user}: " if user else "")

    def _expect_bodies(self, where: str, key: str, owner: str) -> None:
        """Raise InputError for masses and inertias that no arm has at the start."""
        values = self.values()[:, None]
        try:
            self.system().expect_plausible(self._start_positions(values), values)
        except ValueError as error:
            raise InputError(Problem(where, key, f"{owner}{error}")) from error

    def implausible_run(self, columns: Mapping[str, Floats]) -> tuple[int, str] | None:
        """The first run with masses and inertias that no arm has at the start, and what is wrong; None if none has.

        columns  as for `slots_for`, which raises InputError for them
        """
        if MECHANISMS[self.structure().mechanism].regular or not any(map(weighs, columns)):
            return None
        slots, runs = self.slots_for(columns), len(next(iter(columns.values())))
        for first in range(0, runs, _RUNS_AT_ONCE):
            block: Slots = {
                key: value if isinstance(value, float) else value[first : first + _RUNS_AT_ONCE]
                for key, value in slots.items()
            }
            values = per_run(block, list(block), min(_RUNS_AT_ONCE, runs - first)).T
            try:
                self.system().expect_plausible(self._start_positions(values), values)
            except Implausible as error:
                run = first + error.run
                given = ", ".join(f"{key} = {column[run]:.6g}" for key, column in columns.items() if weighs(key))
                return run, f"{given}: {error}"
        return None

    def _start_positions(self, values: Floats) -> Floats:
        """Joint coordinates at the start, n x runs, for values of p, slots x runs."""
        row = np.concatenate([np.zeros(0), *(table.row(0.0) for table in self.tables())])
        return self.system().start_positions(row, values)

    def _canonical(self, overrides: Mapping[str, object], where: str) -> dict[str, object]:
        """Overrides with keys and users' classes named as the document does, so that the same is known for the same.

        Raises InputError for what is given by two names.
        """
        named = {key: canonical_key(key) for key in overrides}
        twice = [key for key, name in named.items() if key != name and name in overrides]
        if twice:
            text = "is another name of {}: give one of them"
            raise InputError(*(Problem(where, key, text.format(named[key])) for key in twice))
        return {
            named[key]: canonical_reference(str(value), self.folder, where, key)
            if key in schema.DOOR_KEYS and schema.names_file(value)
            else value
            for key, value in overrides.items()
        }

    def _joints_with(self, overrides: Mapping[str, object], where: str) -> int:
        """How many joints there are with these overrides; 1 for a mechanism that is unknown, which is told later."""
        given = overrides.get("mechanism.name")
        size = {schema.SIZE: overrides.get(f"mechanism.{schema.SIZE}")}
        if given is None and size[schema.SIZE] is None:
            size = self.document["mechanism"]
        if schema.names_file(given):
            user = read_class(str(given), where, "mechanism.name")
            load_class(user, MECHANISMS, where, "mechanism.name")
            return len(MECHANISMS[user.key].of_size(size_given(user.key, size)).joints)
        name = self.registered(self.document["mechanism"]["name"]) if given is None else str(given)
        return len(MECHANISMS[name].of_size(size_given(name, size)).joints) if name in MECHANISMS else 1

    def _without_excluded(self, overrides: Mapping[str, object]) -> Document:
        """A copy of the document without what the overrides exclude."""
        document = copy.deepcopy(self.document)
        for table in ("reference", "base_motion", "disturbance"):
            kind = overrides.get(f"{table}.kind", document[table]["kind"])
            if kind != document[table]["kind"]:
                stays = {key: document[table][key] for key in ("mount", "mount_rpy") if key in document[table]}
                document[table] = {"kind": kind} | stays
        if overrides.get("control.mode") == "continuous":
            document["control"].pop("period", None)
        velocity = overrides.get("sensor.velocity")
        if isinstance(velocity, str):
            document["sensor"].pop(schema.NOT_WITH_VELOCITY.get(velocity, ""), None)
        for name, registry in (("controller", CONTROLLERS), ("law", LAWS), ("observer", OBSERVERS)):
            old = document["control"][name]
            if overrides.get(f"control.{name}", old) != old:
                document["control"].pop(registry[self.registered(old)].name, None)
        mechanism = document["mechanism"]["name"]
        drive = overrides.get("drive.kind", document["drive"]["kind"])
        if overrides.get("mechanism.name", mechanism) != mechanism:
            control = {k: _without_lists(v) for k, v in document["control"].items() if not isinstance(v, list)}
            hardware = {
                table: {k: v for k, v in document[table].items() if not isinstance(v, list)}
                for table in ("sensor", "actuator")
            }
            document = {name: document[name] for name in ("base_motion", "analysis", "simulation")}
            document |= {"control": control} | hardware
            document["drive"] = {"kind": drive}
        elif overrides.get(f"mechanism.{schema.SIZE}", self.structure().size) != self.structure().size:
            document = self._resized(document, overrides[f"mechanism.{schema.SIZE}"])
        elif drive in DRIVES and drive != document["drive"]["kind"]:
            structure = self.structure()
            shape = schema.schema(
                structure.mechanism,
                cast(DriveKind, drive),
                structure.controller,
                structure.law,
                structure.size,
                observer=structure.observer,
            )
            sections = {name: shape.sections[name] for name in ("plant", "control", "initial")}
            for name, section in (sections | {"drive": shape.kinds["drive"][str(drive)]}).items():
                document[name] = {k: v for k, v in document[name].items() if k in section.model_fields}
        for key in overrides:
            document["simulation"].pop(schema.EXCLUDED_BY.get(key, "").rpartition(".")[2], None)
        given = {key.split(".")[1] for key in overrides if key.startswith("initial.")}
        if overrides.get("initial.on_reference"):
            document.pop("initial", None)
        elif given & {"q", "dq", "q_motor"}:
            document.get("initial", {}).pop("on_reference", None)
        return document

    def _resized(self, document: Document, size: object) -> Document:
        """The document for as many joints: what is the same for all is so for these, and those that go lose theirs.

        What differs from joint to joint stays a list, which is found to have too few or too many entries.
        """
        spread = {
            name: _without_equal(document[name])
            for name in ("mechanism", "drive", "plant", "control", "sensor", "actuator", "initial")
        }
        name = self.structure().mechanism
        kept = {joint.name for joint in MECHANISMS[name].of_size(size_given(name, {schema.SIZE: size})).joints}
        gone = {joint.name for joint in self.system().joints} - kept
        by_joint = {
            table: {key: item for key, item in document[table].items() if key not in gone}
            for table in ("reference", "disturbance")
        }
        return document | spread | by_joint

    def to_toml(self, folder: Path | None = None) -> str:
        """The complete scenario as TOML; loading it gives an equal one.

        folder  where the text is to stand: paths in it count from there; without it they are absolute
        """
        if folder is None:
            return document_text(self.document)
        moved = {user.reference: user.reference_from(folder) for user in self.code}
        return document_text(
            _with_paths(self.document, lambda path: relative_path(path, folder), lambda name: moved.get(name, name))
        )


def load_scenario(source: str | Path, overrides: Mapping[str, object] | None = None) -> Scenario:
    """Load a scenario: a TOML file, or a packaged one by name ("paper/group1_shake").

    overrides  values by dotted key that take the place of the file's; paths in them count from the working directory
    Raises InputError that names all mistakes at once: file, key, what was expected, the nearest valid name. Raises
    TypeError for a source that is no path or name, and overrides that are no mapping of texts.
    """
    if overrides is None:
        return _loaded(source, read=True)
    expect_keys(overrides, "overrides such as {'control.delta': 0.02}")
    return draft_scenario(source).with_overrides(overrides) if overrides else _loaded(source, read=True)


def draft_scenario(source: str | Path) -> Scenario:
    """A scenario that is going to be changed: its signal files are not read yet, for the change may be to them.

    Raises as `load_scenario` does.
    """
    return _loaded(source, read=False)


def _loaded(source: str | Path, *, read: bool) -> Scenario:
    _expect_name(source)
    name = str(source)
    text, folder = read_scenario(source)
    try:
        document = read_toml(text)
    except ValueError as error:
        raise InputError(Problem(name, "", f"is no valid TOML: {error}")) from error
    expect_kind("scenario", source, document)
    scenario = Scenario(name, Path(), *resolve(document, name, folder, read=read))
    if read:
        scenario.expect_computable(name)
    return scenario


def _expect_name(given: object) -> None:
    if not isinstance(given, str | PathLike):
        remedy = ": scenario.with_overrides(...) changes one" if isinstance(given, Scenario) else ""
        raise TypeError(f"expected the path or name of a scenario, got {shortened(repr(given))}{remedy}")


def expect_scenario(given: object) -> None:
    """Raise TypeError, with the remedy, for what is no Scenario (its name, most likely)."""
    if not isinstance(given, Scenario):
        remedy = f": load_scenario({str(given)!r}) gives one" if isinstance(given, str | PathLike) else ""
        raise TypeError(f"expected a Scenario, got {shortened(repr(given))}{remedy}")


def _overridden(source: str) -> str:
    """The place that every mistake in an override is named with: the scenario itself is known to be sound."""
    return f"override of {source}"


def per_run(slots: Slots, keys: Sequence[str], runs: int) -> Floats:
    """Some slots of each run, (runs, keys)."""
    result = np.empty((runs, len(keys)))
    for column, key in zip(result.T, keys, strict=True):
        column[:] = slots[key]
    return result


def _with_paths(document: Document, moved: Callable[[str], str], named: Callable[[str], str]) -> Document:
    """A document whose signal tables name other paths, and whose doors other classes."""
    result = {
        name: table | {"path": moved(table["path"])} if "path" in table else table for name, table in document.items()
    }
    for table, key in schema.DOORS:
        result[table] = {**result[table], key: named(result[table][key])}
    return result


def _without_lists(value: object) -> object:
    """A table without what there is one of for each joint; anything else as it is."""
    return {k: v for k, v in value.items() if not isinstance(v, list)} if isinstance(value, dict) else value


def _without_equal(value: object) -> Any:
    """A table with one number in place of a list of equal ones."""
    if isinstance(value, dict):
        return {key: _without_equal(item) for key, item in value.items()}
    if not isinstance(value, list) or not value or isinstance(value[0], list):
        return value
    return value[0] if all(item == value[0] for item in value) else value


@lru_cache(maxsize=64)
def _expect_printable(structure: Structure) -> None:
    """Raise UnprintableOperation, or whatever a user's class raises, for a structure that no kernel can be made of."""
    lanes.emit(program(structure), {})


def _shape(table: Mapping[str, Any], coordinates: Sequence[str]) -> SignalShape:
    kind = cast(SignalKind, table["kind"])
    if kind == "table":
        return SignalShape(kind, tuple(int(name in table["columns"]) for name in coordinates))
    if kind == "none":
        return SignalShape(kind, (0,) * len(coordinates))
    counted = {"polynomial": "t", "sine": "terms"}[kind]
    terms = (table[name] for name in coordinates)
    return SignalShape(kind, tuple(len(t[counted] if isinstance(t, dict) else t) for t in terms))


def _give_plant_its_own(document: Document, key: str, joints: int) -> None:
    """Write out what the plant has of the controller's, so that one joint's may become another."""
    _, name, *rest = key.split(".")
    nominal = next((document[table][name] for table in ("mechanism", "drive") if name in document[table]), None)
    if isinstance(nominal, list):
        document["plant"].setdefault(name, {"scale": [1.0] * joints} if rest[0] == "scale" else nominal)


def weighs(key: str) -> bool:
    """Whether the masses and inertias of an arm at its start may depend on a dotted key."""
    return key.partition(".")[0] in _ARM


def absent_at(key: str) -> float | None:
    """The number of a dotted key at which a structure does not have what it is of, None for what is always there.

    0 for damping, friction and most effects of sensors and motors, infinity for a limit.
    """
    table, _, rest = key.partition(".")
    name, _, place = rest.partition(".")
    if place and not place.isdecimal():
        return None
    if table in ("sensor", "actuator"):
        return EFFECTS[name].absent if name in EFFECTS and EFFECTS[name].table == table else None
    return 0.0 if table in ("drive", "plant") and name in {item.name for item in FRICTION} else None
