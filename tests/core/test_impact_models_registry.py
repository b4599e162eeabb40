# SPDX-License-Identifier: GPL-3.0-or-later
"""Models and parameters by name, and how wrong ones are refused."""

import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.machinery.parameters import ParameterSpec, choice, declared, number, switch
from rockfall.core.impact_models.registry import COMPARED, MODELS, find_model, parse_settings
from rockfall.core.impact_models.rockyfor3d_tables import SHAPES

FORMAT = {
    "azimi_desvarreux_1977": {"rn", "rt", "definition"},
    "pfeiffer_bowen_1989": {"rn", "rt"},
    "stevens_1998": {"rn", "rt", "rn_sd", "rt_sd", "rotational", "scale_rn_by_velocity"},
    "dorren_2015": {"soil_type", "rn", "rg70", "rg20", "rg10", "block_shape", "deviation_axis"},
    "wyllie_2014": {"inertia"},
    "noel_2017": {"rn_limit", "transfer", "transfer_basis"},
}


def test_the_models_and_parameters_of_the_format_are_there():
    assert set(COMPARED) == set(FORMAT)
    for name, parameters in FORMAT.items():
        assert parameters <= {spec.name for spec in MODELS[name].parameters}


@pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
def test_specifications_are_whole(model):
    assert len({spec.name for spec in model.parameters}) == len(model.parameters)
    for spec in model.parameters:
        assert spec.description
        assert spec.source
        assert spec.checked(spec.default, model.name) == spec.default
        if not spec.choices:
            assert spec.minimum < spec.maximum
    assert model.reference


def test_published_defaults():
    """Noël et al. 2018, § 5: the parameters of the comparison."""
    assert MODELS["azimi_desvarreux_1977"].settings() == {"rn": 0.35, "rt": 0.85, "definition": "velocity"}
    rocky = MODELS["dorren_2015"].settings()
    assert [rocky[name] for name in ("soil_type", "rn", "rg70", "rg20", "rg10", "block_shape")] == [
        "5",
        0.43,
        0.0,
        0.05,
        0.1,
        "rectangular",
    ]
    rocfall = MODELS["stevens_1998"].settings()
    assert [rocfall[name] for name in ("rn", "rt", "rn_sd", "rt_sd")] == [0.35, 0.85, 0.04, 0.04]


def test_rn_is_that_of_the_soil_unless_given():
    model = MODELS["dorren_2015"]
    assert model.settings({"soil_type": "3"})["rn"] == 0.33
    assert model.settings({"soil_type": 7})["rn"] == 0.35
    assert model.settings({"soil_type": "3", "rn": 0.4})["rn"] == 0.4


def test_choices_by_name_and_by_number():
    rocky, rocfall = MODELS["dorren_2015"], MODELS["stevens_1998"]
    for code, (name, _) in enumerate(SHAPES, 1):
        for given in (name, code, str(code), name.upper()):
            assert rocky.settings({"block_shape": given})["block_shape"] == name
    for given in (True, "true", "on", "yes", 1, "1"):
        assert rocfall.settings({"rotational": given})["rotational"] == "on"
    for given in (False, "False", "off", "no", 0, "0"):
        assert rocfall.settings({"rotational": given})["rotational"] == "off"
    assert rocky.numbers()[[spec.name for spec in rocky.parameters].index("block_shape")] == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("wylie_2014.inertia=cube", "There is no impact model 'wylie_2014'. Did you mean wyllie_2014?"),
        ("wyllie_2014.inertai=cube", "wyllie_2014 has no parameter 'inertai'. Did you mean inertia?"),
        ("wyllie_2014.inertia=cub", "wyllie_2014.inertia is 'cub', which is none of its choices. Did you mean cube?"),
        ("azimi_desvarreux_1977.rn=1.7", "azimi_desvarreux_1977.rn is 1.7, outside its range 0…1"),
        ("dorren_2015.rg70=-1", "dorren_2015.rg70 is -1 m, outside its range 0…100 m"),
        ("azimi_desvarreux_1977.rn=nan", "azimi_desvarreux_1977.rn is 'nan', not a number. Give a number, 0…1"),
        ("azimi_desvarreux_1977.rn=high", "not a number"),
        ("dorren_2015.block_shape=0", "none of its choices"),
        ("dorren_2015.soil_type=2.5", "none of its choices"),
        ("azimi_desvarreux_1977.rn", "does not set a parameter. Write NAME.PARAMETER=VALUE"),
        ("rn=0.3", "does not set a parameter"),
        ("azimi_desvarreux_1977.rn=", "does not set a parameter"),
    ],
)
def test_wrong_settings_are_refused(text, message):
    with pytest.raises(InputError) as caught:
        parse_settings([text])
    assert message in str(caught.value)


def test_right_settings():
    texts = ["dorren_2015.rn=0.4", " dorren_2015.deviation_axis = cone", "wyllie_2014.inertia=sphere"]
    expected = {"dorren_2015": {"rn": 0.4, "deviation_axis": "cone"}, "wyllie_2014": {"inertia": "sphere"}}
    assert parse_settings(texts) == expected


def test_an_unknown_name_gives_the_names_when_none_is_near():
    with pytest.raises(InputError, match=r"There are azimi_desvarreux_1977, .*wyllie_2014\."):
        find_model("xyz")


def test_wrong_states_are_refused():
    one = {"velocity": np.ones((1, 3)), "angular_velocity": np.ones((1, 3)), "radius_m": np.ones(1)}
    with pytest.raises(InputError, match="not of length 1"):
        Incident(normal=np.array([[0, 0, 2.0]]), mass_kg=np.ones(1), **one)
    with pytest.raises(InputError, match=r"mass_kg has the shape \(2,\), not \(1,\)"):
        Incident(normal=np.array([[0, 0, 1.0]]), mass_kg=np.ones(2), **one)
    with pytest.raises(InputError, match=r"normal has the shape \(2, 3\), not \(1, 3\)"):
        Incident(normal=np.tile([0, 0, 1.0], (2, 1)), mass_kg=np.ones(1), **one)
    right = Incident(normal=np.array([[0, 0, 1.0]]), mass_kg=np.ones(1), **one)
    for name, count in (("azimi_desvarreux_1977", 1), ("stevens_1998", 3)):
        with pytest.raises(InputError, match=rf"draws have the shape \(1, {count}\), not \(1, "):
            MODELS[name].rebound(right, draws=np.zeros((1, count)))


def test_the_registry_does_not_import_numba():
    code = "import sys, rockfall.core.impact_models.registry; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


NEW_MODEL = """
from typing import NamedTuple

from .machinery.base import ImpactModel, NoDraws
from .machinery.contact import leaving, split
from .machinery.parameters import number
from .machinery.triples import scaled


class Parameters(NamedTuple):
    rn: float = number(1.0, 0, 1, "normal", "none")
    rt: float = number(0.5, 0, 1, "tangential", "none")


def rebound(v1, n, omega1, radius, mass, p, u):
    approach, tangential, _ = split(v1, n)
    return leaving(n, p.rn * approach, scaled(tangential, p.rt)), omega1


MODEL = ImpactModel("mirror_2026", "Mirror", "none", rebound, Parameters, compared=True)
"""
RUN_IT = """
import rockfall.core.impact_models as package
package.__path__.append({folder!r})
import numpy as np
from rockfall.core.impact_models.registry import COMPARED, MODELS
from rockfall.core.impact_models.machinery.base import Incident
velocity, up, still = np.array([[3.0, 0, -2]]), np.array([[0, 0, 1.0]]), np.zeros((1, 3))
state = Incident(velocity, up, still, np.ones(1), np.ones(1))
print("mirror_2026" in COMPARED, MODELS["mirror_2026"].rebound(state).velocity.tolist())
"""


def run_new_model(folder):
    """What a process prints that finds a model in a folder beside the others."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(folder / "kernels")}
    argv = [sys.executable, "-c", RUN_IT.format(folder=str(folder))]
    return subprocess.run(argv, capture_output=True, text=True, check=True, env=environment).stdout.strip()


def test_a_new_model_is_one_file(tmp_path):
    """A module that is found beside the others is a model, compiled like them, and compared when it says so."""
    file = tmp_path / "mirror_2026.py"
    file.write_text(NEW_MODEL, encoding="utf-8")
    assert run_new_model(tmp_path) == "True [[1.5, 0.0, 2.0]]"
    other = NEW_MODEL.replace("p.rn", "p.other").replace("p.rt", "p.rn").replace("p.other", "p.rt")
    file.write_text(other, encoding="utf-8")
    assert run_new_model(tmp_path) == "True [[3.0, 0.0, 1.0]]"
    first, second = (line for line in other.splitlines() if ": float" in line)
    turned = other.replace(first, "-").replace(second, first).replace("-\n", f"{second}\n", 1)
    file.write_text(turned, encoding="utf-8")
    assert run_new_model(tmp_path) == "True [[3.0, 0.0, 1.0]]"


def test_the_compared_models_are_those_of_the_paper_in_its_order():
    """Noël et al. 2018: Azimi, Rockyfor3D, Noël, CRSP, RocFall, Wyllie."""
    names = ["azimi_desvarreux_1977", "dorren_2015", "noel_2017", "pfeiffer_bowen_1989", "stevens_1998", "wyllie_2014"]
    assert list(COMPARED) == names


def test_a_parameter_is_declared_in_a_line():
    class Parameters(NamedTuple):
        speed: float = number(2, 1, 9, "of something", "a book", unit="m/s", symbol="v")
        kind: float = choice("b", ("a", "b"), "which", "a book", first_code=1, verified=False)
        on: float = switch("off", "whether", "a book")

    speed, kind, on = declared(Parameters)
    assert speed == ParameterSpec("speed", 2.0, 1.0, 9.0, (), "of something", "a book", "m/s", "v")
    assert [kind.code(name) for name in ("a", "b")] == [1.0, 2.0]
    assert (kind.name, kind.default, kind.verified) == ("kind", "b", False)
    assert (on.choices, on.code("on"), on.is_switch) == (("off", "on"), 1.0, True)
