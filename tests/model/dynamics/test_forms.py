"""One arm said in three ways, and printed in two forms, has one motion; which form is cheaper is counted."""

import math
import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from springline.model.mechanisms import MECHANISMS, Body, Link, Mechanism
from springline.model.structure import SignalShape, Structure
from springline.model.symbolic import operations
from springline.model.system import System

TransferManipulator: type[Mechanism] = type(MECHANISMS["transfer_manipulator"])


class AsBodies(TransferManipulator):
    """The paper's arm as its two bodies."""

    kinetic_energy, potential_energy = Mechanism.kinetic_energy, Mechanism.potential_energy

    def bodies(self, q, p):
        r2, r3 = self.positions(q, p)
        turned = ca.blockcat([[ca.cos(q[1]), -ca.sin(q[1]), 0], [ca.sin(q[1]), ca.cos(q[1]), 0], [0, 0, 1]])
        return [Body(p.m2, r2), Body(p.m3, r3, turned, p.J)]


class AsTree(TransferManipulator):
    """The paper's arm as a slide with a hinge on it."""

    kinetic_energy, potential_energy = Mechanism.kinetic_energy, Mechanism.potential_energy

    def links(self, p):
        return [
            Link("lift", "prismatic", origin=(p.L1, 0, 0), axis=(0, 1, 0), mass=p.m2),
            Link("rotation", "revolute", parent=0, mass=p.m3, com=(p.L3, 0, 0), inertia=p.J),
        ]


def random_state(rng, n):
    return [rng.normal(size=size) for size in (n, n, 3, 3, 3)]


@pytest.mark.parametrize("form", ["normal", "factored"])
@pytest.mark.parametrize("arm", [TransferManipulator, AsBodies, AsTree])
def test_the_papers_arm_is_one_arm_however_it_is_said(derive, arm, form):
    said, packaged = derive(arm(), form), derive(TransferManipulator(), "normal")
    rng = np.random.default_rng(3)
    for _ in range(50):
        state = random_state(rng, 2)
        mine, theirs = said.terms(*state), packaged.terms(*state)
        scale = np.abs(theirs["bias"]).max() + np.abs(theirs["gravity"]).max()
        for name, value in theirs.items():
            np.testing.assert_allclose(mine[name], value, rtol=1e-13, atol=1e-13 * scale, err_msg=name)


def test_what_counts_where_several_are_said():
    assert TransferManipulator().said_as == "energies"
    assert AsBodies().said_as == "bodies"
    assert AsTree().said_as == "links"

    class WithSpring(AsTree):
        def potential_energy(self, q, gravity, p):
            return super().potential_energy(q, gravity, p) + 50 * q[0] ** 2

    assert WithSpring().said_as == "energies"


def test_an_energy_may_add_to_what_bodies_say(derive):
    """A counterweight's spring beside bodies acts as its derivative does."""

    class WithSpring(AsBodies):
        name = "with_spring"

        def potential_energy(self, q, gravity, p):
            return super().potential_energy(q, gravity, p) + 50 * q[0] ** 2

    q = np.array([0.3, 0.7])
    sprung, plain = derive(WithSpring()).terms(q, q), derive(AsBodies()).terms(q, q)
    np.testing.assert_allclose(sprung["gravity"] - plain["gravity"], [100 * 0.3, 0.0], atol=1e-11)
    np.testing.assert_allclose(sprung["mass"], plain["mass"], rtol=1e-12)


def said_anew(mechanism, method):
    """A mechanism whose class has a method of its own, which does what the inherited one does."""

    def own(self, *given):
        return getattr(super(made, self), method)(*given)

    made = type(f"With_{method}", (type(mechanism),), {method: own})
    return made()


@pytest.mark.parametrize("kinds", ["rr", "rp", "prr", "rrr"])
def test_a_chain_is_one_chain_however_it_is_said(derive, make_chain, make_numbers, kinds):
    """Recursion, projection of its bodies, and Lagrange's equations of their energies."""
    tree = make_chain(kinds)
    bodies, energies = said_anew(tree, "bodies"), said_anew(tree, "kinetic_energy")
    assert [arm.said_as for arm in (tree, bodies, energies)] == ["links", "bodies", "energies"]
    rng = np.random.default_rng(len(kinds))
    numbers, state = make_numbers(len(kinds), rng), random_state(rng, len(kinds))
    recursive = derive(tree, "factored").terms(*state, numbers)
    for arm in (bodies, energies):
        other = derive(arm, "factored").terms(*state, numbers)
        for name, value in recursive.items():
            np.testing.assert_allclose(other[name], value, rtol=1e-11, atol=1e-12 * np.abs(value).max(), err_msg=name)


def test_a_tree_may_branch_and_come_in_any_order(derive, make_chain, make_numbers):
    """Two arms on one trunk; the same with the trunk as the last joint."""
    rng = np.random.default_rng(8)
    numbers, state = make_numbers(3, rng), random_state(rng, 3)
    order = [1, 2, 0]  # of the second tree: its joint k is joint order[k] of the first
    trunk_first, trunk_last = make_chain("rrp", parents=[-1, 0, 0]), make_chain("rpr", parents=[2, 2, -1])
    moved = {f"{key[0]}{k}{key[2:]}": numbers[f"{key[0]}{order[k]}{key[2:]}"] for k in range(3)
             for key in numbers if key[1] == str(k)}  # fmt: skip
    q, dq, *imu = state
    first = derive(trunk_first).terms(q, dq, *imu, numbers)
    last = derive(trunk_last).terms(q[order], dq[order], *imu, moved)
    np.testing.assert_allclose(last["bias"], first["bias"][order], rtol=1e-12)
    np.testing.assert_allclose(last["mass"], first["mass"][np.ix_(order, order)], rtol=1e-12, atol=1e-12)
    assert first["mass"][1, 2] == 0.0, "the two arms do not meet"


def test_the_form_is_the_cheaper_one():
    def equations(**changes):
        return System(Structure(**changes)).arm

    def structure(n):
        return {"mechanism": "planar_arm", "size": n, "reference": SignalShape("sine", (0,) * n)}

    paper, seven = equations(), equations(**structure(7))
    assert paper.form == "normal"
    assert paper.counted["normal"] < paper.counted["factored"]
    assert seven.form == "factored"
    assert "normal" not in seven.counted, "an expanded form of seven joints explodes, and is given up early"
    assert "normal form explodes" in seven.told
    three = equations(**structure(3))
    assert three.counted[three.form] == min(three.counted.values())
    assert len(three.counted) == 2


def operations_of_plant(system):
    """Arithmetic operations of one evaluation of the plant that do not depend on parameters alone."""
    plant = system.function("plant")
    symbols = [ca.SX.sym(plant.name_in(i), plant.size1_in(i)) for i in range(plant.n_in())]
    return operations(plant(*symbols), ca.vertcat(*symbols), ca.vertcat(*symbols[:-1]))


def documented(name):
    """What docs/own-arm.md says that a mechanism takes."""
    page = (Path(__file__).parents[3] / "docs/own-arm.md").read_text("utf-8")
    [count] = re.findall(rf"^\| {re.escape(name)}.*\| ([\d,]+) \|$", page, re.MULTILINE)
    return int(count.replace(",", ""))


def test_seven_links_stay_small():
    still, moving = SignalShape("sine", (0,) * 7), SignalShape("sine", (1,) * 6)
    system = System(Structure(mechanism="planar_arm", size=7, reference=still, base_motion=moving))
    assert operations_of_plant(system) == documented("`planar_arm`, `n = 7`") <= 1000


@pytest.mark.parametrize(
    ("frames", "named", "most"),
    [
        ("generic", "seven revolute joints in space, every frame", 3800),
        ("quarter", "seven revolute joints in space, quarter turns", 2000),
    ],
)
def test_seven_joints_in_space_stay_small(make_chain, monkeypatch, frames, named, most):
    """What is exactly 0 or 1 in a tree is structure: it is neither computed nor printed."""
    monkeypatch.setitem(MECHANISMS, "chain", make_chain("r" * 7, frames))
    still, moving = SignalShape("sine", (0,) * 7), SignalShape("sine", (1,) * 6)
    system = System(Structure(mechanism="chain", reference=still, base_motion=moving))
    assert operations_of_plant(system) == documented(named) <= most


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"origin": (0.3, 0, 0)},
            "link 'a': origin: expected 0, 1, -1 or an expression of parameters, which the class",
        ),
        ({"mass": 2.0}, "link 'a': mass: expected 0, 1, -1 or an expression of parameters"),
        ({"inertia": 0.5}, "link 'a': inertia: expected 0, 1, -1 or"),
        ({"rpy": (0.3, 0, 0)}, "link 'a': rpy: expected whole multiples of pi/2"),
        ({"rpy": (math.nan, 0, 0)}, "link 'a': rpy: contains NaN"),
        ({"axis": (0, 0, 0)}, "link 'a': axis: expected a direction"),
        ({"axis": (0, 0)}, "link 'a': axis: expected 3 x 1, got 2 x 1"),
        ({"axis": "z"}, "link 'a': axis: expected a CasADi SX expression, got str"),
        ({"joint": "ball"}, "link 'a': joint: expected \"revolute\" or \"prismatic\", got 'ball'"),
        ({"parent": 5}, "link 'a': parent: expected the index of a link, or -1 for the base, got 5"),
        ({"parent": 0}, "a -> a is a circle, expected a tree"),
        ({"parent": 1}, "a -> b -> a is a circle, expected a tree"),
        ({"com": (ca.SX.sym("other"), 0, 0)}, "link 'a': com: depends on 'other', which it was not given"),
        ({"inertia": ca.SX.eye(2)}, "link 'a': inertia: expected 3 x 3, got 2 x 2"),
    ],
)
def test_a_tree_that_is_none_is_refused(derive, changes, expected):
    class Bad(TransferManipulator):
        kinetic_energy, potential_energy = Mechanism.kinetic_energy, Mechanism.potential_energy

        def links(self, p):
            return [Link(**({"name": "a", "joint": "revolute"} | changes)), Link("b", "revolute", 0, mass=p.m3)]

    with pytest.raises(ValueError, match=r"mechanism bad: ") as refused:
        derive(Bad())
    assert expected in str(refused.value)


@pytest.mark.parametrize(
    ("bodies", "expected"),
    [
        ([], "expected a list of at least one Body, got []"),
        ([1.0], "bodies[0]: expected a Body, got float"),
        ([Body(1.0, (0, 0))], "bodies[0]: position: expected 3 x 1, got 2 x 1"),
        ([Body(1.0, (0, 0, 0), ca.SX.eye(2))], "bodies[0]: rotation: expected 3 x 3, got 2 x 2"),
        ([Body(1.0, (0, 0, 0), None, ca.SX.zeros(3))], "bodies[0]: inertia: expected 3 x 3, got 3 x 1"),
        ([Body(ca.SX.sym("k"), (0, 0, 0))], "bodies[0]: mass: depends on 'k', which it was not given"),
    ],
)
def test_bodies_that_are_none_are_refused(derive, bodies, expected):
    class Bad(AsBodies):
        def bodies(self, q, p):
            return bodies

    with pytest.raises(ValueError, match="mechanism bad: ") as refused:
        derive(Bad())
    assert expected in str(refused.value)
