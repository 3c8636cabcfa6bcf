"""A short pass of fixed cases over every kind, and past failures; `scripts/fuzz.py` makes the long one."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.cases import KINDS
from tests.fuzz.runner import Runner, is_right

CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.json"))
CASES = 25
"""Of each kind in this short pass."""


@pytest.fixture(scope="module")
def runner():
    with Runner() as runner:
        yield runner


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_case_ends_in_a_result_or_in_one_line(runner, kind):
    @settings(max_examples=CASES, suppress_health_check=list(HealthCheck))
    @given(KINDS[kind])
    def check(case):
        verdict = runner(case)
        assert is_right(verdict), f"{verdict}: {json.dumps(case)[:2000]}"

    check()


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
def test_past_failures_stay_mended(runner, path):
    verdict = runner(json.loads(path.read_text()))
    assert is_right(verdict), verdict


def test_a_worker_that_dies_is_seen_and_started_again(runner):
    assert runner({"kind": "no such kind"})["outcome"] == "wrong"
    runner._process.kill()
    assert runner({"kind": "link", "query": ""})["outcome"] == "crash"
    assert runner({"kind": "link", "query": ""})["outcome"] == "result"


def test_strategies_make_json():
    @settings(max_examples=20)
    @given(st.one_of(*KINDS.values()))
    def check(case):
        assert json.loads(json.dumps(case))["kind"] in KINDS

    check()
