"""What workers need to know of a campaign, here or on a cluster."""

from __future__ import annotations

from base64 import b64encode
from pickle import dumps
from typing import Any

from gapsense._os.checked import Entry
from gapsense._os.processes import Died, Marks
from gapsense._os.workers import Job
from gapsense.campaign.plan import Plan
from gapsense.campaign.prepare import Prepared
from gapsense.campaign.worker import CampaignRuns
from gapsense.cosim.fmu.descriptions import Descriptions
from gapsense.cosim.run.apart import limit_of
from gapsense.cosim.run.worker import request
from gapsense.cosim.scenario.records import Scenario
from gapsense.cosim.sweep import death_entry

TRIES = 2  # of a run whose process dies: somebody may have ended it


def job(scenario: Scenario, descriptions: Descriptions, signals: tuple[str, ...], decimation: int) -> Job:
    """What a process does, on whatever machine."""
    task = {
        "pickled": b64encode(dumps((scenario, descriptions))).decode(),
        "signals": list(signals),
        "decimation": decimation,
    }
    entry_of = death_entry(scenario, descriptions)

    def with_last_words(died: Died, marks: Marks) -> Entry:
        """The error, with the last that a process wrote which ended by itself."""
        last, entry = died.words.rpartition("\n")[2], entry_of(died, marks)
        return {"error": f"{entry['error']} It wrote: {last}"} if last and "exit code" in died.cause else entry

    return Job(
        prepare=CampaignRuns,
        task=task,
        workers=1,
        guest=None,
        on_worker_death=with_last_words,
        limit=limit_of(scenario),
        tries=TRIES,
    )


def local_job(prepared: Prepared, workers: int) -> Job:
    """The same for so many processes here."""
    study, plan = prepared.study, prepared.plan
    made = job(prepared.scenario, prepared.descriptions, study.signals, study.decimation)
    return made._replace(workers=workers, request=lambda index: asked(plan, index))


def asked(plan: Plan, index: int) -> dict[str, Any]:
    """What a worker is asked for a run."""
    return request(index, plan.shift(index), plan.values(index))
