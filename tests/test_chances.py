"""What is left to chance: a run with drawn seeds fails though all claims are true at most once in a thousand runs."""

from __future__ import annotations

import math

import pytest

from tests.seeds import mostly

# of a whole run
BUDGET = 1e-3


def test_the_whole_suite_fails_by_chance_once_in_a_thousand_runs(request: pytest.FixtureRequest) -> None:
    """The chances of all claims of this run about a share of drives, added up."""
    chances = {
        item.nodeid: item.function.chance
        for item in request.session.items
        if isinstance(item, pytest.Function) and hasattr(item.function, "chance")
    }
    print(f"{len(chances)} claims about a share of drives: {sum(chances.values()):.1e}")
    assert sum(chances.values()) <= BUDGET


@pytest.mark.parametrize("share", [0.98, 0.95])
def test_a_claim_fails_as_rarely_as_it_says_and_a_false_one_often(share: float) -> None:
    """Every outcome of the drives, weighted: the chance is exact; where a fifth of the drives passes, most runs fail."""

    def failing(true: float) -> float:
        """Chance of a failure where a share `true` of the drives passes; outcomes of all drives by recursion."""

        def run(outcomes: tuple[bool, ...]) -> float:
            drawn = iter(outcomes)

            @mostly(share)
            def test(seed: int) -> None:
                assert next(drawn)

            try:
                test(seed=1)
            except StopIteration:  # it asks for one drive more
                return true * run((*outcomes, True)) + (1.0 - true) * run((*outcomes, False))
            except AssertionError:
                return 1.0
            return 0.0

        return run(())

    assert math.isclose(failing(share), mostly(share)(lambda seed: None).chance, rel_tol=1e-9)  # type: ignore[attr-defined]
    assert failing(0.2) > 0.6
