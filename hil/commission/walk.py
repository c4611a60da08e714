"""The whole walk: bus first, then the machine's own devices, then the machine among the others."""

from hil.commission import bus
from hil.commission.devices import steps_for
from hil.commission.person import NoAnswerError
from hil.commission.setting import CommissionSetting

#: What must be in order before anything is said on either bus.
_BEFORE_SPEAKING = (bus.termination, bus.listening, bus.node_id_free, bus.digests)


async def walk(setting: CommissionSetting) -> None:
    """Do every step and note it. What a failed step forbids is noted as not done."""
    try:
        setting.protocol.person = await setting.person.ask("Your name, for the protocol?")
        for step in _BEFORE_SPEAKING:
            if not await step(setting):
                setting.leave_out("all further steps", "what is wrong has to be mended first")
                return
        await _try_devices(setting)
        await bus.joins(setting)
    except NoAnswerError:
        setting.leave_out("all further steps", "nobody answers any more")


async def _try_devices(setting: CommissionSetting) -> None:
    steps = steps_for(setting.machine.kind)
    if not steps:
        kind = setting.machine.kind.name.lower()
        setting.leave_out("devices", f"there is no table for a {kind}: try its sensors and actuators by hand")
    for step in steps:
        await step(setting)
