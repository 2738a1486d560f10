"""All that serves runners in one API process."""

from __future__ import annotations

from typing import Final

import structlog
from sqlalchemy.exc import SQLAlchemyError

from buildarena_api.runners.lease_queue import LeaseQueue
from buildarena_api.runners.outcomes import Outcomes, drop_dead_uploads
from buildarena_backend.artifacts.uploads import Uploads
from buildarena_backend.errors import ArtifactStoreError
from buildarena_backend.periodic import Periodic
from buildarena_backend.process.context import Context

DROP_EVERY_S: Final = 60.0

log = structlog.get_logger(__name__)


class RunnerService:
    """What the routes of runners use.

    Args:
        context: The process' connections.

    Attributes:
        uploads: What runners have uploaded.
        lease_queue: Finds trials.
        outcomes: Ends leases.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        settings = context.settings
        self.uploads = Uploads(settings.artifacts_location, settings.artifact_options)
        self.lease_queue = LeaseQueue(context)
        self.outcomes = Outcomes(context, self.uploads)
        self._cleaner = Periodic(self._clean, name="uploads", period_s=DROP_EVERY_S)

    def start(self) -> None:
        """Begins to remove uploads of dead leases every now and then."""
        self._cleaner.start()

    def close(self) -> None:
        """Ends what was started."""
        self._cleaner.stop()

    def _clean(self) -> None:
        try:
            dropped = drop_dead_uploads(self._context, self.uploads)
        except (ArtifactStoreError, SQLAlchemyError) as error:
            log.warning("uploads_not_cleaned", error=str(error).splitlines()[0])
        except Exception:
            # Whatever it was, the next time may do.
            log.exception("uploads_not_cleaned")
        else:
            if dropped:
                log.info("uploads_dropped", leases=dropped)
