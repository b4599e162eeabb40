# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters the models of a film have: typed ones before a file's before the project's."""

import argparse
from pathlib import Path

import pytest
from rockfall.core.commands.options import add_parameter_options, model_parameters
from rockfall.core.errors import InputError
from rockfall.core.exchange.parameters import checked_parameters, write_parameters
from rockfall.core.film.job import FilmJob

MODELS = ("noel_2017", "wyllie_2014")


def arguments(*texts: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_parameter_options(parser)
    return parser.parse_args(texts)


def test_typed_before_file_before_project(tmp_path):
    write_parameters({"noel_2017": {"rt": 0.5, "rn_limit": 1.5}, "dorren_2015": {"rg70": 0.2}}, tmp_path / "p.toml")
    known = {"noel_2017": {"rt": 0.6, "transfer": 0.1}, "wyllie_2014": {"inertia": "sphere"}}
    found = model_parameters(
        arguments("--set", "noel_2017.rt=0.4", "--parameters", str(tmp_path / "p.toml")), MODELS, known
    )
    assert {key: float(value) for key, value in found["noel_2017"].items()} == {
        "rt": 0.4,
        "rn_limit": 1.5,
        "transfer": 0.1,
    }
    assert found["wyllie_2014"] == {"inertia": "sphere"}
    assert set(found) == set(MODELS), "the file's other models are not used"


def test_nothing_given_is_nothing():
    assert model_parameters(arguments(), MODELS) == {}


def test_parameters_travel_with_the_job():
    job = FilmJob("film", Path("p.toml"), Path("f.mp4"), models=MODELS, parameters={"noel_2017": {"rt": 0.513}})
    assert FilmJob.from_json(job.to_json()) == job


def test_a_project_with_a_wrong_parameter_is_told():
    with pytest.raises(InputError, match=r"project\.toml.*rt"):
        checked_parameters({"noel_2017": {"rtt": 1.0}}, "project.toml")
