"""The API's documents, as its contract describes them. Generated: `make openapi` writes this file.

A key that may be missing is NotRequired. Nothing checks a document against its type: a newer
service may have added keys.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired, TypedDict

Timestamp = Annotated[str, "date-time"]
"""A moment, as ISO 8601 with its zone."""


Reading = Literal["ours", "published"]
"""How flags are read; the values are what the API and the commands take."""


class AgreementRow(TypedDict):
    """One engine on one task.

    Attributes:
        kappa: Cohen's kappa of the verdicts.
        low: Lower end of its exact 95 % interval.
        near: Share of common successes whose indicators differ by a quarter at most.
        rank_correlation: Spearman's, of the indicators.
        same_verdict: Share that both call a success, or both do not.
    """

    engine: str
    high: float
    kappa: float | None
    low: float
    near: float | None
    rank_correlation: float | None
    same_verdict: float
    simulation_version: str
    task: str
    trials: int


class AgreementTable(TypedDict):
    """All engines on all tasks of one track in the game; empty for other tracks."""

    rows: list[AgreementRow]
    track: str | None


class AttemptView(TypedDict):
    """One worker's attempt at a job's stage.

    Attributes:
        result: done, fault, handed_back, lost, budget_exhausted, cancelled.
        token: Fencing token: grows with every attempt.
    """

    detail: str | None
    ended_at: Timestamp | None
    result: str | None
    stage: str
    started_at: Timestamp
    token: int
    worker: str


class BenchMachineView(TypedDict):
    """A machine under construction.

    Attributes:
        available: Machines that an assembly can be put together from.
        detached: Blocks without a path to the starting block.
        mass: Mass units.
        sub_structures: Of an assembly.
    """

    available: list[str]
    control_sequence: list[PressView]
    detached: list[str]
    mass: float
    name: str
    parts: list[BenchPartView]
    sub_structures: list[SubStructureView]


class BenchPartView(TypedDict):
    """A part of a machine under construction.

    Attributes:
        actions: What keys can be bound to.
        bindings: Keys by action.
        end: Of a connector: where it ends.
        ends: Block and face of a connector's two ends.
        faces: Of a block: what can be built on.
        flipped: Whether a wheel's sense of rotation is reversed.
        position: Of its root point, world frame, units.
        quaternion: World from block, (w, x, y, z).
        sits_on: Block and face that it is attached to; null for starting blocks, connectors and
            blocks whose base was removed.
        spins: Whether its spin can be flipped.
        start: Of a connector: where it begins, world frame, units.
    """

    actions: list[str]
    bindings: dict[str, list[str]]
    end: list[float] | None
    ends: list[list[str]]
    faces: list[FaceView]
    flipped: bool
    id: str
    module: str
    position: list[float]
    quaternion: list[float]
    sits_on: list[str] | None
    spins: bool
    start: list[float] | None


class BinView(TypedDict):
    """Jobs whose sessions wrote about as much.

    Attributes:
        high: Most output tokens.
        low: Fewest output tokens.
        mean: Of the performance; the task's best job has 1.
    """

    high: float
    low: float
    mean: float | None
    median: float | None
    trials: int


class BlockPlace(TypedDict):
    """A block of the machine as it was built.

    Attributes:
        position: Of its root point, machine's frame, units.
    """

    id: str
    module: str
    position: list[float]
    quaternion: list[float]


class Board(TypedDict):
    """The leaderboard of one track.

    Attributes:
        reading: How flags were read.
        track: null when no job has ended.
        tracks: Every track with ended jobs.
    """

    flags: NotRequired[list[FlagView]]
    overall: NotRequired[list[OverallView]]
    published: NotRequired[list[PublishedOverall]]
    reading: Reading
    tasks: list[TaskBoard]
    track: str | None
    tracks: list[str]


class BodyView(TypedDict):
    """A solid of a module, in the block's frame, units.

    Attributes:
        quaternion: Block from solid, (w, x, y, z); a cylinder's axis is its z.
        size: Full extents; of a cylinder its diameter twice, and its length.
    """

    center: list[float]
    quaternion: list[float]
    shape: Literal["box", "cylinder", "sphere"]
    size: list[float]


class Budget(TypedDict):
    """What all jobs of a sweep, or of a key, may spend together; then nothing new starts.

    Attributes:
        max_tokens: Input and output together.
    """

    max_cost_usd: NotRequired[float | None]
    max_requests: NotRequired[int | None]
    max_tokens: NotRequired[int | None]


class BudgetView(TypedDict):
    """What may be spent, and what was."""

    max_cost_usd: float | None
    max_requests: int | None
    max_tokens: int | None
    spent_cost_usd: float
    spent_requests: int
    spent_tokens: int


class CallerView(TypedDict):
    """Who asks, and what they may do.

    Attributes:
        key: Id of the API key; null for the operator, and where no keys are asked for.
        keys_required: Whether requests need an API key.
        scope: The greatest that the key has; it includes those before it.
    """

    key: str | None
    keys_required: bool
    scope: Literal["read", "submit", "admin"]


class ChangePage(TypedDict):
    """Some changes, the newest first.

    Attributes:
        next_before: Give it as `before` to get the next page.
    """

    changes: list[ChangeView]
    next_before: int | None
    track: str | None


class ChangeView(TypedDict):
    """Something that changed on a board.

    Attributes:
        why: Reason that came with the change, if any.
    """

    after: dict[str, Any] | None
    at: Timestamp
    before: dict[str, Any] | None
    id: int
    job_id: str
    kind: Literal["entered", "left", "rescored", "corrected", "unscored"]
    model: str
    task: str
    why: str | None


class ChapterView(TypedDict):
    """How one machine came about.

    Attributes:
        kind: An assembly is put together from copies of the sub-structures.
    """

    kind: Literal["machine", "sub_structure", "assembly"]
    name: str
    steps: list[StepView]


class Check(TypedDict):
    """One part of the service.

    Attributes:
        advice: What to do when it is not ok.
    """

    advice: NotRequired[str]
    detail: str
    name: str
    ok: bool


class ClosedLoop(TypedDict):
    """Further rounds for samples that failed, after reading the simulator's results.

    Attributes:
        analyst: An analyst looks at each failure and advises the next round.
        rounds: The first one included.
    """

    analyst: NotRequired[bool]
    rounds: int


class Comparison(TypedDict):
    """Two models on all tasks that both played."""

    first: str
    reading: Reading
    second: str
    tasks: list[TaskDuelView]
    track: str | None


class ConnectorPlace(TypedDict):
    """A connector of the machine.

    Attributes:
        joint: What trajectories call it where it breaks.
        rope: Whether it pulls and never pushes.
    """

    end: EndView
    id: str
    joint: str
    module: str
    rope: bool
    start: EndView


class CostView(TypedDict):
    """Performance in bins of output tokens, over the tasks of a category."""

    bins: list[BinView]
    category: str


class Decoding(TypedDict):
    """How a model's replies are sampled. The defaults are the paper's."""

    max_tokens: NotRequired[int | None]
    temperature: NotRequired[float | None]
    top_p: NotRequired[float | None]


class DifferingPair(TypedDict):
    """A task and a seed on which just one of both succeeded."""

    first: JobFigures
    second: JobFigures
    seed: int
    task: str


class DimensionsView(TypedDict):
    """Scores along the difficulty dimensions, from 0 (last on every task) to 1 (first)."""

    configuration: str
    dimensions: dict[str, float]
    model: str


class EndView(TypedDict):
    """An end of a connector.

    Attributes:
        point: In that block's frame, units.
    """

    block: str
    point: list[float]


class FaceView(TypedDict):
    """A face of a block under construction.

    Attributes:
        center: World frame, units.
        normal: Outwards, world frame, unit length.
        side: Where it looks, as feedback says it.
        taken_by: The block that it touches by an attachment; null if it takes a block.
    """

    center: list[float]
    label: str
    normal: list[float]
    side: str
    taken_by: str | None


class FailureView(TypedDict):
    """How the jobs of one model configuration ended.

    Attributes:
        outcomes: Ended jobs by outcome, with its reason where there is one.
        refusals: Refused actions by class.
    """

    actions: int
    configuration: str
    model: str
    outcomes: dict[str, int]
    refusals: dict[str, int]
    refused_actions: int


class Figures(TypedDict):
    """What a board's figures are drawn from.

    Attributes:
        dimensions: Ranked configurations, the best first.
        front: Cost against performance, the best first.
    """

    cost: list[CostView]
    dimensions: list[DimensionsView]
    failures: list[FailureView]
    front: list[FrontView]
    reading: Reading
    track: str | None


class FlagView(TypedDict):
    """A flag that scores can have.

    Attributes:
        disqualifying: Whether our reading counts its trials as failures.
        published: Whether the published reading leaves its trials out.
    """

    disqualifying: bool
    meaning: str
    name: str
    published: bool


class FlameView(TypedDict):
    """A flame's ball, ahead of the block's shown centre in the way it points.

    Attributes:
        along: Units from the centre.
    """

    along: float
    radius: float


class FrontView(TypedDict):
    """One model configuration's cost and performance over all tasks.

    Attributes:
        mean_rank: The smaller, the better; null if a task is missing.
        pareto: No other model is both better and cheaper.
    """

    configuration: str
    cost_usd_mean: float | None
    mean_rank: float | None
    model: str
    output_tokens_mean: float | None
    pareto: bool
    success_rate_mean: float | None


class HTTPValidationError(TypedDict):
    """HTTPValidationError."""

    detail: NotRequired[list[ValidationError]]


class Health(TypedDict):
    """The service as a whole."""

    checks: list[Check]
    status: Literal["ok", "degraded", "down"]


class ImportedView(TypedDict):
    """The result of an import.

    Attributes:
        added: Jobs that were not there before.
        jobs: Jobs it consists of.
        unverified: Scores among them: they count when their verification, which was requested, has
            found them again.
    """

    added: int
    jobs: int
    sweep_id: str
    unverified: int


class JobDetail(TypedDict):
    """A job with its manifest, attempts and artifacts.

    Attributes:
        artifacts: SHA-256 of each artifact by name.
        censored: Whether the indicator is at least what it says.
        configuration: Hash of model, decoding and limits.
        faults: Infrastructure faults at the current stage.
        flags: Remarks on the score; the board says what of.
        imported_from: The archive it was imported from, if it was.
        indicator: The task's performance indicator.
        manifest: Versions of what can change the score.
        outcome: How it ended; null until it has.
        owner: Id of the API key that submitted it.
        reason: Class of the failure, if any.
        refusals: Refused actions by class.
        verified_at: When an imported job's figures were found again here; until then they are in no
            ranking.
    """

    actions: int
    artifacts: dict[str, str]
    attempts: list[AttemptView]
    censored: bool
    configuration: str
    created_at: Timestamp
    detail: str | None
    faults: int
    finished_at: Timestamp | None
    flags: list[str] | None
    id: str
    imported_from: str | None
    indicator: float | None
    manifest: dict[str, Any] | None
    metrics: dict[str, Any] | None
    model: str
    outcome: (
        Literal["success", "unsuccessful", "construction_failed", "limit", "errored", "cancelled"]
        | None
    )
    owner: str | None
    reason: str | None
    refusals: dict[str, int] | None
    refused_actions: int
    seed: int
    stage: Literal["construct", "simulate"]
    started_at: Timestamp | None
    state: Literal["queued", "on_hold", "running", "done"]
    success: bool | None
    task: str
    task_version: str
    track: str
    usage: UsageView
    verified_at: Timestamp | None


class JobFigures(TypedDict):
    """A job as a comparison counts it."""

    indicator: float
    job: str
    success: bool


class JobFileView(TypedDict):
    """An artifact of a job.

    Attributes:
        hash: SHA-256 of the bytes.
        size: Bytes.
    """

    hash: str
    media_type: str
    name: str
    size: int


class JobPage(TypedDict):
    """Some jobs, in the order that was asked for.

    Attributes:
        next_cursor: Give it as `cursor` to get the next page.
    """

    jobs: list[JobView]
    next_cursor: str | None


class JobSpec(TypedDict):
    """One job: a task, a model and a seed.

    Attributes:
        one_shot: Show an example construction.
    """

    closed_loop: NotRequired[ClosedLoop | None]
    decoding: NotRequired[Decoding]
    limits: NotRequired[Limits]
    model: str
    one_shot: NotRequired[bool]
    prompts: NotRequired[str]
    seed: NotRequired[int]
    simulator: NotRequired[str]
    task: str
    workflow: NotRequired[str]


class JobView(TypedDict):
    """A job: one task x model x seed on one track.

    Attributes:
        censored: Whether the indicator is at least what it says.
        configuration: Hash of model, decoding and limits.
        faults: Infrastructure faults at the current stage.
        flags: Remarks on the score; the board says what of.
        imported_from: The archive it was imported from, if it was.
        indicator: The task's performance indicator.
        outcome: How it ended; null until it has.
        owner: Id of the API key that submitted it.
        reason: Class of the failure, if any.
        refusals: Refused actions by class.
        verified_at: When an imported job's figures were found again here; until then they are in no
            ranking.
    """

    actions: int
    censored: bool
    configuration: str
    created_at: Timestamp
    detail: str | None
    faults: int
    finished_at: Timestamp | None
    flags: list[str] | None
    id: str
    imported_from: str | None
    indicator: float | None
    metrics: dict[str, Any] | None
    model: str
    outcome: (
        Literal["success", "unsuccessful", "construction_failed", "limit", "errored", "cancelled"]
        | None
    )
    owner: str | None
    reason: str | None
    refusals: dict[str, int] | None
    refused_actions: int
    seed: int
    stage: Literal["construct", "simulate"]
    started_at: Timestamp | None
    state: Literal["queued", "on_hold", "running", "done"]
    success: bool | None
    task: str
    task_version: str
    track: str
    usage: UsageView
    verified_at: Timestamp | None


class KeyCreated(TypedDict):
    """A key that was just made.

    Attributes:
        job_owners: Of a runner key: whose; null for everybody's.
        previous_until: Until when the secret before the present one is good; null without one.
        secret: What requests carry; it can't be read again.
        simulators: Of a runner key: what it may lease jobs of.
        used_at: When it was last used, to the minute.
    """

    budget: NotRequired[BudgetView | None]
    created_at: Timestamp
    expires_at: Timestamp | None
    id: str
    job_owners: list[str] | None
    name: str
    previous_until: Timestamp | None
    revoked_at: Timestamp | None
    scopes: list[str]
    secret: str
    simulators: list[str] | None
    used_at: Timestamp | None


class KeyView(TypedDict):
    """A key without its secret.

    Attributes:
        job_owners: Of a runner key: whose; null for everybody's.
        previous_until: Until when the secret before the present one is good; null without one.
        simulators: Of a runner key: what it may lease jobs of.
        used_at: When it was last used, to the minute.
    """

    budget: NotRequired[BudgetView | None]
    created_at: Timestamp
    expires_at: Timestamp | None
    id: str
    job_owners: list[str] | None
    name: str
    previous_until: Timestamp | None
    revoked_at: Timestamp | None
    scopes: list[str]
    simulators: list[str] | None
    used_at: Timestamp | None


class LeftOut(TypedDict):
    """What can't be compared."""

    kind: Literal["model", "task"]
    name: str
    why: str


class Limits(TypedDict):
    """What one job's session may use; a session that reaches one ends as ``limit``.

    Attributes:
        max_tokens: Input and output together.
    """

    max_cost_usd: NotRequired[float | None]
    max_requests: NotRequired[int | None]
    max_seconds: NotRequired[float | None]
    max_tokens: NotRequired[int | None]


class LimitsView(TypedDict):
    """How much a session may do.

    Attributes:
        call_bytes: Bytes of one call's arguments.
        calls: Calls it may make.
        idle_s: Seconds without a call after which it is cancelled.
        session_bytes: Bytes of all arguments and answers.
    """

    call_bytes: int
    calls: int
    idle_s: int
    session_bytes: int


class MachineCheckView(TypedDict):
    """What a file holds, and what is wrong with it.

    Attributes:
        bounds: Smallest and largest coordinates, units; null without blocks.
        broken_rule: The rule of the task that it breaks, if any.
        detached: Blocks without a path to the starting block.
        faults: Why it cannot be put through a trial.
        mass: Mass units.
        name: What the file calls the machine; "" if it does not.
        parts: Blocks and connectors.
        remarks: What of the file the machine does not hold.
    """

    bounds: list[list[float]] | None
    broken_rule: str | None
    control_sequence: list[PressView]
    detached: list[str]
    faults: list[str]
    mass: float
    name: str
    parts: int
    remarks: list[str]
    scene: MachineScene


class MachineScene(TypedDict):
    """The machine's parts, and the modules that they are of."""

    blocks: list[BlockPlace]
    connectors: list[ConnectorPlace]
    modules: dict[str, ModuleShape]


class ManifestEntry(TypedDict):
    """What the manifests behind an entry say about one thing.

    Attributes:
        values: value, and jobs that have it; empty when there are too many.
    """

    distinct: int
    name: str
    values: list[dict[str, Any]]


class ModelEstimate(TypedDict):
    """What one model's part of a sweep would use.

    Attributes:
        cost_usd: null when no price is known.
    """

    cost_usd: float | None
    input_tokens: float
    jobs: int
    model: str
    output_tokens: float
    requests: float


class ModelView(TypedDict):
    """A model that jobs can name.

    Attributes:
        model: The provider's own name of the snapshot.
    """

    baseline: bool
    model: str
    name: str
    provider: str


class ModuleShape(TypedDict):
    """What blocks of a module look like.

    Attributes:
        center: Its shown centre in the block's frame: what trajectories give as its position.
        pointing: The way a cannon or torch points, block's frame.
    """

    bodies: list[BodyView]
    center: list[float]
    flames: list[FlameView]
    kind: str
    pointing: list[float] | None


class ModuleView(TypedDict):
    """A module that machines are made of.

    Attributes:
        actions: What keys can be bound to.
        categories: Groups it is looked up in; none for basic modules.
        faces: Labels of the faces that take a block.
        simulated: Whether both engines have its physics.
        size: Extents along its own x, y and z, units; null for connectors.
    """

    actions: list[str]
    categories: list[str]
    cost: float
    description: str
    faces: list[str]
    kind: str
    mass: float
    name: str
    simulated: bool
    size: list[float] | None


class NewKey(TypedDict):
    """A request for a key.

    Attributes:
        days: Days until it expires; null for never.
        job_owners: Of a runner key: ids of the keys whose jobs may be leased; null for all.
        name: Who holds it.
        scopes: read, submit and admin: each includes those before it; or runner alone, which may
            lease trials and nothing else.
        simulators: Of a runner key: the simulators whose jobs its runners may lease.
    """

    budget: NotRequired[Budget | None]
    days: NotRequired[int | None]
    job_owners: NotRequired[list[str] | None]
    name: str
    scopes: list[Literal["read", "submit", "admin", "runner"]]
    simulators: NotRequired[list[str] | None]


class OpenSession(TypedDict):
    """A request to build.

    Attributes:
        agent: Its name on the leaderboard, which belongs to the key that first uses it.
        kind: Who builds: a program, on leaderboards `agent/NAME`, or a person, `human/NAME`. No
            name is of both kinds.
    """

    agent: str
    kind: NotRequired[Literal["agent", "human"]]
    seed: NotRequired[int]
    simulator: NotRequired[str]
    task: str


class OverallView(TypedDict):
    """One model configuration over the built-in tasks of the board, or over those asked for.

    Attributes:
        dimensions: Score, 0 to 1, by difficulty dimension.
        mean_rank: Over tasks, by success rate and by indicator.
        missing: Tasks of the board without a counted job.
        pareto: No other model is both better and cheaper.
        rank: null when a task is missing.
    """

    baseline: bool
    configuration: str
    cost_usd_mean: float | None
    dimensions: dict[str, float]
    mean_rank: float | None
    missing: list[str]
    model: str
    output_tokens_mean: float | None
    pareto: bool
    rank: int | None
    rank_high: int | None
    rank_low: int | None
    success_rate_mean: float | None
    trials: int


class PartView(TypedDict):
    """A part, and where it is after the step.

    Attributes:
        bindings: Keys by action.
        end: Of a connector: where it ends.
        flipped: Whether a wheel's sense of rotation is reversed.
        position: Of its root point, world frame, units.
        quaternion: World from block, (w, x, y, z).
        start: Of a connector: where it begins, world frame, units.
    """

    bindings: dict[str, list[str]]
    end: list[float] | None
    flipped: bool
    id: str
    module: str
    position: list[float]
    quaternion: list[float]
    start: list[float] | None


class PlacedView(TypedDict):
    """A block, and where it would have been.

    Attributes:
        position: Of its root point, world frame, units.
        quaternion: World from block, (w, x, y, z).
    """

    id: str
    module: str
    position: list[float]
    quaternion: list[float]


class PressView(TypedDict):
    """A key that is held for a while."""

    hold_for_s: float
    key: str
    time_s: float


class Problem(TypedDict):
    """RFC 9457 problem details."""

    detail: str
    errors: NotRequired[list[ValidationIssue]]
    status: int
    title: str
    type: NotRequired[str]


class ProgressView(TypedDict):
    """Progress of a sweep.

    Attributes:
        outcomes: Ended jobs by outcome.
        stages: Jobs that have not ended, by stage and state.
    """

    cost_usd: float
    done: int
    input_tokens: int
    outcomes: dict[str, int]
    output_tokens: int
    requests: int
    stages: dict[str, int]
    total: int


class PublishedOverall(TypedDict):
    """The paper's models ranked over its nine tasks, among themselves."""

    mean_rank: float
    model: str
    rank: int
    rank_high: int
    rank_low: int


class PublishedView(TypedDict):
    """The paper's figures: a reference, never ranked with ours.

    Attributes:
        matches: Our models with the same snapshot.
    """

    indicator_mean: float
    input_tokens_mean: float | None
    matches: list[str]
    model: str
    output_tokens_mean: float | None
    parts_mean: float
    requests_mean: float | None
    snapshot: str
    success_high: float
    success_low: float
    success_rate: float
    successes: int
    trials: int


class ReplayView(TypedDict):
    """How a job's machine came about, as the geometry library builds it again.

    Attributes:
        chapters: Sub-structures, then their assembly; each begins with nothing.
        complete: False where the steps are too many or too large: the last are left out.
        exact: Whether it ends in exactly the kept machine; null while none is kept.
    """

    chapters: list[ChapterView]
    complete: bool
    exact: bool | None


class Result(TypedDict):
    """One ended job, with all that reports are made of.

    Attributes:
        requests: null, as the next three, for an external agent: it reports none.
        rounds: In order; more than one in a closed loop.
        unverified: Imported and not found again here: it counts nowhere.
    """

    actions: int
    configuration: str
    cost_usd: float | None
    decoding: dict[str, Any]
    flags: list[str]
    imported: bool
    indicator: float
    input_tokens: int | None
    job_id: str
    model: str
    outcome: str
    output_tokens: int | None
    parts: int | None
    reason: str | None
    refusals: dict[str, int]
    refused_actions: int
    requests: int | None
    rounds: list[RoundView]
    seed: int
    success: bool
    task: str
    task_version: str
    track: str
    unverified: bool


class Resumption(TypedDict):
    """How to resume a sweep."""

    budget: NotRequired[Budget | None]


class Rotation(TypedDict):
    """A request for another secret of a key.

    Attributes:
        overlap_hours: Hours that the present secret stays good; 0 ends it at once.
    """

    overlap_hours: NotRequired[float]


class RoundView(TypedDict):
    """One simulated machine of a job.

    Attributes:
        machine: Hash of its document.
    """

    flags: list[str]
    indicator: float
    machine: str
    parts: int | None
    success: bool


class Row(TypedDict):
    """One model configuration on one task. What does not exist is null.

    Attributes:
        baseline: A built-in model for comparison.
        censored: Counted jobs that carried everything; if there are any, the mean and the best
            indicator are at least what they say.
        configuration: Hash of model, decoding and limits.
        decoding: How replies were sampled, and the limits of the sessions, if any.
        ended: All ended jobs, also errored and cancelled ones.
        errored: Jobs that infrastructure faults ended: in no average.
        flagged: Scored jobs that a flag makes failures or, in the published reading, leaves out.
        flags: Scored jobs by flag.
        imported: Jobs that came from another service's archive.
        indicator_low: Lower end of the 95 % interval; null when there are too few data.
        jobs: Path of the list of its jobs.
        manifest: Path of the versions behind its score.
        newest: When the last of its jobs ended.
        pass_all: Chance that all of k tries succeed, by k.
        pass_at: Chance that one of k tries succeeds, by k.
        rank: Statistically tied models share a rank.
        rank_low: Lower end of the place's interval; all of a board's hold together at 95 %.
        reasons: Counted jobs that failed, by reason.
        refusals: Refused actions by class.
        simulated: Counted jobs whose machine was finished and simulated.
        success_high: Upper end of the 95 % exact interval.
        success_low: Lower end of the 95 % exact interval.
        success_rate: null when nothing was scored.
        success_rate_of_ended: Successes of all ended jobs.
        too_few_data: Fewer than 5 successes: no interval of the mean indicator would hold.
        trials: Counted jobs: the denominator of the averages.
        unverified: Imported jobs whose figures were not found again here: they count nowhere.
    """

    baseline: bool
    cancelled: int
    censored: int
    configuration: str
    cost_per_success_usd: float | None
    cost_usd_mean: float | None
    decoding: dict[str, Any]
    ended: int
    errored: int
    flagged: int
    flags: dict[str, int]
    imported: int
    indicator_best: float | None
    indicator_high: float | None
    indicator_low: float | None
    indicator_mean: float | None
    input_tokens_mean: float | None
    invalid_action_rate: float | None
    jobs: str
    manifest: str
    model: str
    newest: Timestamp | None
    outcomes: dict[str, int]
    output_tokens_mean: float | None
    parts_mean: float | None
    pass_all: dict[str, float]
    pass_at: dict[str, float]
    rank: int | None
    rank_high: int | None
    rank_low: int | None
    reasons: dict[str, int]
    refusals: dict[str, int]
    requests_mean: float | None
    simulated: int
    success_high: float | None
    success_low: float | None
    success_rate: float | None
    success_rate_of_ended: float | None
    successes: int
    too_few_data: bool
    trials: int
    unverified: int


class SceneView(TypedDict):
    """All that a trial looks like but for how it goes.

    Attributes:
        machine: null while nothing was built.
        scenario: As tasks have it: duration_s, terrain, cargo, placement, control. Terrain is
            tilted by slope_deg about the east-west axis through its centre.
    """

    machine: MachineScene | None
    scenario: dict[str, Any]


class SessionOpened(TypedDict):
    """An open session.

    Attributes:
        briefing: All that an agent must know, as Markdown: how it plays, the statement, the frame,
            the rules and the modules with sizes, masses, face letters and actions.
        calls: Calls made so far; more than 0 if it was open already.
        id: Also the id of the job that will hold the score.
        statement: What to build; part of the briefing.
    """

    briefing: str
    calls: int
    id: str
    limits: LimitsView
    statement: str
    tools: list[ToolView]


class SessionView(TypedDict):
    """A session and what stands on its workbench.

    Attributes:
        bytes: Bytes of all arguments and answers so far.
        calls: Calls made so far.
        machines: What was built so far; the one that is simulated is the assembly, or the only.
        open: Whether it takes calls.
    """

    bytes: int
    calls: int
    job: JobView
    limits: LimitsView
    machines: list[BenchMachineView]
    open: bool
    tools: list[ToolView]


class StepView(TypedDict):
    """One action and what came of it.

    Attributes:
        attempted: Blocks where a refused action would have put them, if that is known.
        control_sequence: All key presses, if the action changed them.
        moved: Parts in another place than before.
        reason: Refusal class; null if it was accepted.
        rebound: Parts with other keys or sense of rotation.
        removed: Ids of parts that are gone.
        text: Why it was refused; null if it was accepted.
        turn: Index of its turn in the transcript; null for what the session did by itself.
    """

    accepted: bool
    action: str
    added: list[PartView]
    arguments: Any
    attempted: list[PlacedView]
    control_sequence: list[PressView] | None
    moved: list[PartView]
    reason: str | None
    rebound: list[PartView]
    removed: list[str]
    text: str | None
    turn: int | None


class SubStructureView(TypedDict):
    """A copy of a machine in an assembly.

    Attributes:
        source: The machine that it is a copy of.
    """

    letter: str
    source: str


class SweepAccepted(TypedDict):
    """A sweep that was accepted.

    Attributes:
        added: Jobs that are new; the others had been submitted before.
        jobs: Jobs it consists of.
        resumed: Whether an earlier submission of the same jobs was resumed.
    """

    added: int
    id: str
    jobs: int
    resumed: NotRequired[bool]


class SweepComparison(TypedDict):
    """Two sweeps, model by model; p-values are adjusted over the tests of one model (Holm)."""

    first: SweepSide
    left_out: list[LeftOut]
    pairs: list[SweepPair]
    reading: Reading
    second: SweepSide


class SweepEstimate(TypedDict):
    """What a sweep would consist of, from the mean figures that the paper reports per task.

    Attributes:
        cost_usd: Sum over the models with a known price.
    """

    cost_usd: float
    jobs: int
    models: list[ModelEstimate]


class SweepPage(TypedDict):
    """Some sweeps, newest first."""

    next_cursor: str | None
    sweeps: list[SweepView]


class SweepPair(TypedDict):
    """A model in both sweeps; or the only model of each.

    Attributes:
        differing: By task and seed.
    """

    differing: list[DifferingPair]
    first: str
    second: str
    tasks: list[TaskDuelView]


class SweepSide(TypedDict):
    """One of two sweeps.

    Attributes:
        ended: Jobs that have ended.
        tracks: Of its ended jobs.
    """

    ended: int
    id: str
    name: str
    tracks: list[str]


class SweepSpec(TypedDict):
    """A matrix of jobs: every task with every model and every seed.

    Attributes:
        one_shot: Show an example construction.
        samples: Seeds 0 … samples-1.
    """

    budget: NotRequired[Budget | None]
    closed_loop: NotRequired[ClosedLoop | None]
    decoding: NotRequired[Decoding]
    limits: NotRequired[Limits]
    models: list[str]
    name: NotRequired[str]
    one_shot: NotRequired[bool]
    prompts: NotRequired[str]
    samples: NotRequired[int | None]
    seeds: NotRequired[list[int] | None]
    simulator: NotRequired[str]
    tasks: list[str]
    workflow: NotRequired[str]


class SweepView(TypedDict):
    """A sweep with its progress.

    Attributes:
        last_event: What later requests answer holds every event up to this one: whoever has read
            the jobs gives it as `Last-Event-ID` and hears only what happened since.
        owner: Id of the API key that submitted it.
        state: budget_exhausted when a budget is used up; done when every job has ended.
    """

    budget: BudgetView | None
    created_at: Timestamp
    id: str
    last_event: int
    name: str
    owner: str | None
    progress: ProgressView
    spec: dict[str, Any]
    state: Literal["active", "paused", "budget_exhausted", "cancelled", "done"]


class TaskBoard(TypedDict):
    """All models on one task, the best first.

    Attributes:
        custom: Whether somebody uploaded the task.
        outdated: Ended jobs of other versions, which are left out.
    """

    custom: bool
    indicator: str
    outdated: int
    published: list[PublishedView]
    rows: list[Row]
    task: str
    unit: str
    version: str


class TaskDetail(TypedDict):
    """A version of a task with its whole document.

    Attributes:
        created_at: When this version was; null for built-in ones.
        current: Whether new submissions get this version.
        custom: Whether somebody uploaded it.
        difficulty: Weight of each difficulty dimension, if any.
        document: The whole document, defaults included; JSON is YAML, so it can be uploaded.
        indicator: Name of the figure it is ranked by.
        statement: What the model reads.
        unit: The figure's unit; "1" for a ratio.
        version: Content hash of all that can change a score.
    """

    category: str
    created_at: Timestamp | None
    current: bool
    custom: bool
    difficulty: dict[str, int]
    document: dict[str, Any]
    indicator: str
    level: int
    name: str
    statement: str
    title: str
    unit: str
    version: str


class TaskDuelView(TypedDict):
    """Two models on one task; tests only where they share seeds.

    Attributes:
        difference: Success rate of the first minus that of the second.
        low: Lower end of its 95 % interval, unpaired.
        success_p: Adjusted over the tests of both figures on all tasks (Holm).
    """

    difference: float
    high: float
    indicator: TestView | None
    indicator_p: float | None
    low: float
    success: TestView | None
    success_p: float | None
    successes: list[int]
    task: str
    trials: list[int]


class TaskView(TypedDict):
    """A task that jobs can name.

    Attributes:
        created_at: When this version was; null for built-in ones.
        custom: Whether somebody uploaded it.
        difficulty: Weight of each difficulty dimension, if any.
        indicator: Name of the figure it is ranked by.
        statement: What the model reads.
        unit: The figure's unit; "1" for a ratio.
        version: Content hash of all that can change a score.
    """

    category: str
    created_at: Timestamp | None
    custom: bool
    difficulty: dict[str, int]
    indicator: str
    level: int
    name: str
    statement: str
    title: str
    unit: str
    version: str


class TestView(TypedDict):
    """A paired test on shared seeds."""

    difference: float
    method: Literal["exact McNemar", "Wilcoxon signed-rank"]
    p_value: float
    pairs: int


class ToolCall(TypedDict):
    """One action.

    Attributes:
        arguments: What the tool's parameters ask for.
        machine: Sub-structure it is meant for; 'assembly' is put together from the others.
    """

    arguments: NotRequired[Any]
    machine: NotRequired[str]
    tool: str


class ToolOutcome(TypedDict):
    """What came of an action.

    Attributes:
        feedback: The state in words, or what would have been allowed.
        reason: Refusal class, if it was refused.
    """

    feedback: str
    ok: bool
    reason: str | None


class ToolView(TypedDict):
    """A tool that the agent may call.

    Attributes:
        parameters: JSON schema of its arguments.
    """

    description: str
    name: str
    parameters: dict[str, Any]


class TroubleView(TypedDict):
    """Attempts at a sweep's jobs that failed alike; faults never count as failures of a model.

    Attributes:
        detail: A sentence for people.
        jobs: Of how many jobs.
        newest: When the last one ended.
    """

    attempts: int
    detail: str | None
    jobs: int
    model: str
    newest: Timestamp
    result: Literal["fault", "lost"]
    stage: Literal["construct", "simulate"]


class UsageView(TypedDict):
    """What a job's session used; null where an external agent reports nothing."""

    cached_tokens: int | None
    cost_usd: float | None
    input_tokens: int | None
    output_tokens: int | None
    reasoning_tokens: int | None
    requests: int | None


class ValidationError(TypedDict):
    """ValidationError."""

    ctx: NotRequired[dict[str, Any]]
    input: NotRequired[Any]
    loc: list[str | int]
    msg: str
    type: str


class ValidationIssue(TypedDict):
    """One thing that is wrong with a file or a request.

    Attributes:
        choices: What would be valid, where known.
        field: Where, for example tasks[1].
        line: Line of an uploaded text, from 1.
    """

    choices: NotRequired[list[str]]
    field: NotRequired[str]
    line: NotRequired[int | None]
    message: str


class VerificationView(TypedDict):
    """A check of one job.

    Attributes:
        report: ok, and checks with name, ok, kept and found; null until it is done.
    """

    created_at: Timestamp
    finished_at: Timestamp | None
    id: str
    job_id: str
    report: dict[str, Any] | None
    state: Literal["queued", "running", "done"]


class VerifyAccepted(TypedDict):
    """Verifications that were requested.

    Attributes:
        left: Jobs that found no room, as a key has a number of verifications open at most: ask for
            them one by one when some have ended.
        scored: Scored jobs of the model.
        verifications: Ids; see /v1/verifications/{id}.
    """

    left: list[str]
    scored: int
    verifications: list[str]


class VerifyRequest(TypedDict):
    """Which results to verify.

    Attributes:
        sample: Default: all.
        seed: Seed of the random sample.
    """

    model: str
    sample: NotRequired[int | None]
    seed: NotRequired[int]
    tasks: NotRequired[list[str] | None]
    track: NotRequired[str | None]


class WorkerView(TypedDict):
    """A process that works on jobs.

    Attributes:
        alive: Whether it reported within the last 15 seconds.
        clock_ahead_s: How far its clock is ahead of the database's.
        id: KIND@HOST:PID beside the database, runner@KEY/NAME where it reaches only the API.
    """

    alive: bool
    clock_ahead_s: float | None
    host: str
    id: str
    kind: str
    peak_memory_bytes: int | None
    pid: int
    queues: list[str]
    seen_at: Timestamp
    started_at: Timestamp
    versions: dict[str, Any]


class BoardFilters(TypedDict, total=False):
    """Which jobs a leaderboard is made of.

    Attributes:
        track: Default: the first with ended jobs.
        task: Only these tasks.
        level: Only tasks of these levels.
        category: Only tasks of these categories, over whose built-in ones models are ranked then;
            by default the overall ranking is over the paper's nine tasks.
        model: Only these models.
        sweep: Only jobs of these sweeps, and their tracks.
        since: Only jobs ended then or later.
        until: Only jobs ended before.
        reading: How flags are read: ours counts disqualified trials as failures, published leaves
            out what the published evaluation calls hacked.
    """

    track: str | None
    task: list[str] | None
    level: list[int] | None
    category: list[str] | None
    model: list[str] | None
    sweep: list[str] | None
    since: Timestamp | None
    until: Timestamp | None
    reading: Reading


class JobFilters(TypedDict, total=False):
    """Which jobs are listed, and in which order.

    Attributes:
        sweep: Only this sweep's jobs.
        configuration: Of the model: hash of its decoding and limits too.
        since: Only jobs ended then or later.
        until: Only jobs ended before.
        reason: Class of the failure.
        flag: Only jobs with this flag.
        indicator_min: Only with at least this indicator.
        indicator_max: Only with at most this indicator.
        text: Only jobs in whose id, task, model, reason or detail it stands, in any case.
        id_prefix: Only ids with this prefix.
        sort: Jobs without such a figure come last, in both directions.
        order: desc: the newest, or greatest, first.
    """

    sweep: str | None
    task: str | None
    model: str | None
    track: str | None
    task_version: str | None
    configuration: str | None
    since: Timestamp | None
    until: Timestamp | None
    state: Literal["queued", "on_hold", "running", "done"] | None
    outcome: (
        Literal["success", "unsuccessful", "construction_failed", "limit", "errored", "cancelled"]
        | None
    )
    reason: str | None
    flag: str | None
    indicator_min: float | None
    indicator_max: float | None
    text: str | None
    id_prefix: str | None
    sort: Literal["created", "finished", "indicator", "cost", "task", "model", "seed"]
    order: Literal["asc", "desc"]
