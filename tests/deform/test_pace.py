import itertools
from collections.abc import Iterable

import pytest

from animator.deform.pace import Pace, PaceConfig

CONFIG = PaceConfig(most_steps=100, window=10, gain=0.02, settling_steps=20, final_rate=0.1)


def rates(losses: Iterable[float], config: PaceConfig = CONFIG) -> list[float]:
    pace, found = Pace(config), []
    for loss in losses:
        if not pace.goes_on:
            break
        found.append(pace.rate)
        pace.note(loss)
    return found


def falling(share: float) -> Iterable[float]:
    """Losses that fall by this share in a window of ten."""
    return (100.0 * (1.0 - share) ** (step / 10) for step in itertools.count())


def test_a_falling_loss_gets_all_steps_and_settles_at_the_end():
    found = rates(falling(0.05))
    assert len(found) == 100
    assert set(found[:81]) == {1.0}
    assert found[80:] == sorted(found[80:], reverse=True)
    assert found[-1] == pytest.approx(0.1 ** (19 / 20))


def test_a_loss_that_falls_too_slowly_settles_after_two_windows():
    assert len(rates(falling(0.019))) == 20 + 20
    assert len(rates(falling(0.021))) == 100


def test_it_settles_when_the_loss_stops_falling():
    losses = itertools.chain(itertools.islice(falling(0.2), 40), itertools.repeat(1e2 * 0.8**4))
    found = rates(losses)
    assert found.index(found[-1]) + 1 == len(found) == 60 + 20


@pytest.mark.parametrize("most_steps", [0, 1, 7])
def test_few_steps_all_settle(most_steps):
    config = PaceConfig(most_steps=most_steps)
    found = rates(falling(0.5), config)
    assert len(found) == most_steps
    assert found == sorted(set(found), reverse=True)
