"""Does any input end in a traceback or a crash? Random cases of every kind for some minutes.

    python scripts/fuzz.py --minutes 10 --seed 1

Every kind has its share of the time, so that quick ones have more cases. Prints a count of outcomes by kind as JSON; the first case of each cause of failure goes to
tests/fuzz/corpus.
"""

import argparse
import hashlib
import json
import re
import sys
import time
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from tests.fuzz.cases import KINDS  # noqa: E402
from tests.fuzz.runner import Runner, is_right  # noqa: E402

ROUND = 20
"""Cases of a kind before another may have its turn."""


def main():
    """Run until the time is up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--cases", type=int, default=10**9, help="stop after so many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", choices=sorted(KINDS), default=sorted(KINDS))
    parser.add_argument("--corpus", type=Path, default=ROOT / "tests/fuzz/corpus")
    options = parser.parse_args()
    outcomes = {kind: Counter() for kind in options.kinds}
    end, turn, failures = time.monotonic() + 60.0 * options.minutes, options.seed, set()
    spent = dict.fromkeys(options.kinds, 0.0)
    with Runner() as runner:
        while time.monotonic() < end and sum(map(Counter.total, outcomes.values())) < options.cases:
            kind = min(spent, key=spent.__getitem__)
            begun = time.monotonic()
            run_round(runner, kind, turn, outcomes[kind], failures, options.corpus)
            spent[kind] += time.monotonic() - begun
            turn += 1
            left = max(0.0, end - time.monotonic()) / 60.0
            total = sum(map(Counter.total, outcomes.values()))
            print(
                f"\r{total} cases, {len(failures)} failures, {left:.1f} min left",
                end="",
                file=sys.stderr,
            )
    print(file=sys.stderr)
    found = {kind: dict(counter) for kind, counter in outcomes.items()}
    print(
        json.dumps(
            {"seed": options.seed, "outcomes": found, "failures": sorted(failures)}, indent=1
        )
    )
    return 1 if failures else 0


def run_round(runner, kind, number, outcomes, failures, corpus):
    """Some cases of a kind; failures are written to the corpus."""

    @seed(number)
    @settings(
        max_examples=ROUND, deadline=None, database=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(KINDS[kind])
    def check(case):
        verdict = runner(case)
        outcomes[verdict["outcome"]] += 1
        if not is_right(verdict):
            text = json.dumps(case, indent=1, sort_keys=True)
            cause = f"{case.get('name', kind)} {re.sub(r'[0-9]+', '', verdict['why'])[:60]}"
            name = f"{kind}_{hashlib.sha256(cause.encode()).hexdigest()[:10]}"
            if name not in failures:
                failures.add(name)
                (corpus / f"{name}.json").write_text(text + "\n")
                print(f"\n{name}: {verdict}", file=sys.stderr)

    check()


if __name__ == "__main__":
    sys.exit(main())
