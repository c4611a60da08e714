"""What the kit of conformity (onboard/conform) plays and judges of a car park's nodes."""

from onboard.systems.car_park.conform import awards, blocked, calls, company, lives, plans, rights, work

SCENES = (*calls.SCENES, *awards.SCENES, *blocked.SCENES, *rights.SCENES, *work.SCENES, *lives.SCENES, *company.SCENES)
WATCHERS = ((plans.PLANS, plans.watch),)
