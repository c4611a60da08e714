"""A run of a whole site judged by the checkers, which see only what was on its buses."""

from onboard.trace.check.checks import Checks, Verdict
from tests.system.scene import Scene


def verdict_of(scene: Scene, *, disturbed: bool = False) -> Verdict:
    """All rules over everything that was said in a scene."""
    checks = Checks(scene.simulation.site, disturbed=disturbed)
    for said in scene.said:
        checks.feed_message(said.time_us, said.message, said.bus)
    return checks.finish()


def assert_checked(scene: Scene, *, disturbed: bool = False) -> Verdict:
    """Fails with the report where a rule was broken, or where nothing was there to be judged by one."""
    verdict = verdict_of(scene, disturbed=disturbed)
    assert verdict.is_good, "\n" + "\n".join(verdict.lines())
    return verdict
