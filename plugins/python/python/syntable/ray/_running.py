"""One dataset by the workers of a cluster. Each worker is a Ray task that claims scenes."""

from __future__ import annotations

import contextlib
import inspect
import math
import os
import re
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import ray  # type: ignore[import-not-found, import-untyped, unused-ignore]
from ray.util.scheduling_strategies import (  # type: ignore[import-not-found, import-untyped, unused-ignore]
    NodeAffinitySchedulingStrategy,
)

from .. import _syntable, verbs
from .._arguments import claim_of, path, whole
from ..errors import RecipeError, SyntableError
from ..generating import scene_range, thread_count
from ..progress import Event, Progress, listener
from ..recipes import Recipe, as_recipe
from ..verbs import Outcome
from ._nodes import Job, Probe, Unfit, connect, options, place

__all__ = ["run"]

#: Failures of a worker in a row without a scene, after which it is not started again.
FAILURES = 4
#: Pause after the first of them, which doubles, and its limit, s.
PAUSE_S, LONGEST_PAUSE_S = 1.0, 30.0
#: Interval at which the driver looks at its workers, s.
POLL_S = 0.2
#: Interval at which the driver looks for new nodes, s.
NODES_S = 5.0
#: Time for other workers to return after the end of the run, s.
RETURN_S = 15.0
#: Time for workers to stop after an interrupt, before they are killed, s.
STOP_S = 10.0
#: Time for the last messages of a worker to arrive, s.
ARRIVE_S = 5.0
#: Shortest interval between the messages of a worker, s.
SEND_S = 0.2


def run(
    recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str],
    *,
    scenes: range | tuple[int, int] | int | None = None,
    claim: bool | int = True,
    lease: float = 60.0,
    workers: int | None = None,
    threads: int | None = None,
    gpus: int = 0,
    plugins: Iterable[str | os.PathLike[str]] = (),
    allow_code: bool = False,
    runtime_env: Mapping[str, Any] | None = None,
    progress: Progress = None,
) -> Outcome:
    """Makes the dataset of a recipe on a Ray cluster, or continues it. The files are those of ``st.run``, byte for byte.

    Workers claim scenes as those of ``st.run(…, claim=True)`` do. The driver starts them, and starts a worker again that
    fails, or whose node is lost. It gives a worker up that fails four times in a row without a scene, or with an error
    that no retry mends; the call raises its error when no worker is left. Warnings name the node of each failure. Ctrl-C
    ends all workers and keeps finished scenes; the same call continues.

    The call uses the cluster of ``ray.init``, and calls it if the program has not.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts. It travels to the nodes with all recipes that it
            extends. Its assets do not: each node reads them by their paths. ``${NAME}`` in a path is the variable of
            the node or, if the node has none, that of the driver.
        out: Folder of the dataset that all nodes share, or its URL in an object store, such as ``"s3://bucket/mine"``.
        scenes: Numbers of the scenes to make, such as ``range(0, 10)``. Default: all.
        claim: Number of scenes that a worker claims at once; True is 1.
        lease: Time without a sign of life after which others take over the claimed scenes of a worker, s.
        workers: Number of workers. More than the cluster has room for wait, so that an autoscaler adds nodes. Default:
            as many as the cluster has room for. Nodes that join later get workers, too.
        threads: Number of threads of a worker, and of processors that it reserves. Default: those of the smallest node.
        gpus: Number of graphics cards that a worker reserves. A worker uses all equal cards of its node: reserve all.
        plugins: Python files and modules with stages, which each worker loads. The text of a file travels with the
            recipe.
        allow_code: Run code that the recipe brings: native libraries and programs.
        runtime_env: Ray's environment of the workers, such as ``{"env_vars": …}`` for credentials, or
            ``{"working_dir": …}`` for a folder with assets, from which relative paths then start. Ray copies a folder of
            this machine only if the program has not called ``ray.init``, or has passed it there.
        progress: Shows progress, or receives every event of all workers; see `Progress`.

    Returns:
        The dataset after the run.

    Raises:
        RecipeError: If the recipe has mistakes.
        SyntableError: If no worker can begin or continue, a node does not share the folder, or nodes have different
            versions of the package. Scenes that fail do not raise; see `Outcome`.
        KeyboardInterrupt: After Ctrl-C.
    """
    if claim is False:
        raise ValueError("workers of a cluster claim scenes: claim is True or a number of scenes")
    heard = listener(progress)
    recipe = as_recipe(recipe)
    made = scene_range(scenes)
    out = path(out, "out")
    reserved = Reserved(
        thread_count(threads), whole(gpus, "gpus", 0, 1024), None if workers is None else whole(workers, "workers", 1)
    )
    order = Order(
        job=Job.of(recipe, plugins),
        out=out if _syntable.is_url(out) else os.path.abspath(out),
        scenes=made,
        claim=claim,
        lease=lease,
        allow_code=bool(allow_code),
    )
    block, _ = claim_of(claim, lease) or (1, lease)
    first, end = made or (0, recipe.scenes)
    env = connect(runtime_env)
    team = Team(order, reserved, math.ceil(max(end - first, 1) / block), env, heard)
    return team.run()


@dataclass(frozen=True)
class Order:
    """The work of all workers: the arguments of ``st.run``."""

    job: Job
    out: str
    scenes: tuple[int, int] | None
    claim: bool | int
    lease: float
    allow_code: bool
    threads: int = 1
    probe: Probe | None = None


@dataclass(frozen=True)
class Report:
    """How a worker ended.

    Attributes:
        place: Its node.
        outcome: The dataset after the run; None after a failure.
        error: The failure.
    """

    place: str
    outcome: Outcome | None = None
    error: SyntableError | None = None


class Mailbox:
    """Events of all workers on their way to the driver: an actor on the driver's node."""

    def __init__(self) -> None:
        self._events: list[tuple[int, Event]] = []

    def put(self, worker: int, events: list[Event]) -> None:
        """Takes events of a worker."""
        self._events.extend((worker, event) for event in events)

    def take(self) -> list[tuple[int, Event]]:
        """Gives all events that have come."""
        events, self._events = self._events, []
        return events


class Sender:
    """Sends the events of a worker, several in one message."""

    def __init__(self, mailbox: Any, worker: int) -> None:
        self._mailbox, self._worker = mailbox, worker
        self._events: list[Event] = []
        self._latest = 0.0
        self._sent: Any = None

    def __call__(self, event: Event) -> None:
        self._events.append(event)
        if time.monotonic() - self._latest > SEND_S:
            self.flush()

    def flush(self) -> None:
        """Sends what waits."""
        if self._events:
            self._sent = self._mailbox.put.remote(self._worker, self._events)
            self._events, self._latest = [], time.monotonic()

    def end(self) -> None:
        """Sends what waits, and lets it arrive before the worker's report."""
        self.flush()
        with contextlib.suppress(ray.exceptions.RayError):
            ray.get(self._sent, timeout=ARRIVE_S)


def work(order: Order, mailbox: Any, worker: int) -> Report:
    """The task of a worker."""
    send = Sender(mailbox, worker)
    send({"event": "worker", "place": place()})
    try:
        with order.job.at_node() as recipe:
            if order.probe is not None:
                order.probe.check()
            outcome = verbs.run(
                recipe,
                order.out,
                scenes=order.scenes,
                claim=order.claim,
                lease=order.lease,
                threads=order.threads,
                allow_code=order.allow_code,
                progress=send,
            )
        return Report(place(), outcome=outcome)
    except SyntableError as error:
        return Report(place(), error=worded(error))
    except Exception as error:
        # Its class may be unknown to the driver. A refused argument stays refused.
        temporary = not isinstance(error, (TypeError, ValueError))
        return Report(place(), error=SyntableError(f"{type(error).__name__}: {error}", temporary=temporary))
    finally:
        send.end()


def worded(error: SyntableError) -> SyntableError:
    """The error of a worker, with the function of each argument that it advises and that `run` lacks."""
    lacking = sorted(set(inspect.signature(verbs.run).parameters) - set(inspect.signature(run).parameters))
    arguments = re.compile(rf"`(?:{'|'.join(lacking)})(?:=True)?`")

    def named(text: str) -> str:
        # `run` always claims.
        text = text.replace("without `claim`", "without `claim`, by `st.run`")
        return arguments.sub(lambda found: f"{found[0]} of `st.run`", text)

    error.args = tuple(named(text) if isinstance(text, str) else text for text in error.args)
    error.message = named(error.message)
    error.help = None if error.help is None else named(error.help)
    return error


@dataclass(frozen=True)
class Reserved:
    """What workers reserve; None where the cluster decides."""

    threads: int | None
    gpus: int
    workers: int | None

    def threads_of(self, nodes: list[tuple[int, int]]) -> int:
        """Number of threads of a worker. Nodes are numbers of processors and cards.

        Raises:
            SyntableError: If no node has room for a worker, and the caller names no number.
        """
        if self.threads is not None:
            return self.threads
        each = [cpus // (cards // self.gpus if self.gpus else 1) for cpus, cards in nodes if cards >= self.gpus]
        fit = [threads for threads in each if threads > 0]
        if not fit:
            what = f"with {self.gpus} graphics cards" if self.gpus else "with a processor"
            raise SyntableError(
                f"the cluster has no node {what} (name `threads` and `workers`, and the workers wait for a node)"
            )
        return min(fit)

    def room(self, nodes: list[tuple[int, int]], threads: int) -> int:
        """Number of workers that fit on some nodes."""
        rooms = (min(cpus // threads, cards // self.gpus) if self.gpus else cpus // threads for cpus, cards in nodes)
        return sum(rooms)


def nodes_now() -> list[tuple[int, int]]:
    """Numbers of processors and graphics cards of the living nodes."""
    living = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    return [(int(node.get("CPU", 0)), int(node.get("GPU", 0))) for node in living]


@dataclass
class Worker:
    """A worker as the driver sees it.

    Attributes:
        number: Its number.
        due: When it may start, on the monotonic clock.
        place: Its node; empty until it has begun.
        failures: Its failures in a row without a scene.
    """

    number: int
    due: float = 0.0
    place: str = ""
    failures: int = 0


class Team:
    """The driver's part: starts workers, restarts and ends them."""

    def __init__(
        self,
        order: Order,
        reserved: Reserved,
        most: int,
        runtime_env: dict[str, Any] | None,
        heard: Callable[[Event], None],
    ) -> None:
        threads = reserved.threads_of(nodes_now())
        self._order = replace(order, threads=threads)
        self._probe = Probe(order.out, None)
        self._reserved, self._most = reserved, most
        self._heard = heard
        self._start = self._looked = time.monotonic()
        self._env = runtime_env
        # A lost worker fails here, and is started again here: Ray would do so in silence, and for ever.
        self._task = ray.remote(work).options(
            **options(threads, reserved.gpus, self._env, max_retries=0, name="syntable")
        )
        self._mailbox: Any = None
        self._letter: Any = None
        self._workers: list[Worker] = []
        self._running: dict[Any, Worker] = {}
        self._waiting: list[Worker] = []
        self._outcomes: list[Outcome] = []
        self._last_error: SyntableError | None = None
        self._seen = Seen()

    def run(self) -> Outcome:
        """Makes the dataset."""
        self._probe = Probe.new(self._order.out)
        self._order = replace(self._order, probe=self._probe)
        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=True)
        try:
            self._mailbox = (
                ray.remote(Mailbox)
                .options(**options(0, 0, self._env, scheduling_strategy=here, max_restarts=-1))
                .remote()
            )
            self._add(self._reserved.workers or max(1, self._reserved.room(nodes_now(), self._order.threads)))
            while not self._outcomes:
                self._look()
                self._begin()
                self._collect()
            self._wait()
        except BaseException:
            self._stop()
            raise
        finally:
            self._probe.delete()
            if self._mailbox is not None:
                # The cluster may be gone.
                with contextlib.suppress(Exception):
                    ray.kill(self._mailbox)
        return self._end()

    def _add(self, workers: int) -> None:
        """Brings the number of workers up to a number. More workers than claims would have nothing to do."""
        while len(self._workers) < min(workers, self._most):
            self._workers.append(Worker(len(self._workers)))
            self._waiting.append(self._workers[-1])

    def _look(self) -> None:
        """Adds workers for nodes that have joined."""
        if time.monotonic() - self._looked < NODES_S:
            return
        self._looked = time.monotonic()
        self._probe.touch()
        if self._reserved.workers is None:
            self._add(self._reserved.room(nodes_now(), self._order.threads))

    def _begin(self) -> None:
        """Starts the workers that are due."""
        now = time.monotonic()
        for worker in [worker for worker in self._waiting if worker.due <= now]:
            self._waiting.remove(worker)
            worker.place = ""
            self._running[self._task.remote(self._order, self._mailbox, worker.number)] = worker
        if not self._running and not self._waiting:
            raise self._last_error or SyntableError("no worker is left")

    def _collect(self) -> None:
        """Waits a moment for workers that end, and passes events on."""
        if not self._running:
            time.sleep(POLL_S)
            return
        ended, _ = ray.wait(list(self._running), timeout=POLL_S)
        self._listen()
        for task in ended:
            worker = self._running.pop(task)
            try:
                report = ray.get(task)
            except ray.exceptions.RayError as error:
                self._lost(worker, error)
                continue
            if report.error is not None:
                self._failed(worker, report.error, report.place)
            elif report.outcome is not None:
                self._outcomes.append(report.outcome)

    def _lost(self, worker: Worker, error: Any) -> None:
        """Handles a worker that cannot report."""
        if isinstance(error, ray.exceptions.TaskCancelledError):
            self._failed(worker, SyntableError("the worker was canceled", temporary=True), worker.place)
            return
        if isinstance(error, (ray.exceptions.RayTaskError, ray.exceptions.RuntimeEnvSetupError)):
            text = str(error).strip()
            if isinstance(error, ray.exceptions.RayTaskError):
                text = text.splitlines()[-1]
            help = "every node needs the package syntable, such as by `runtime_env`"
            raise SyntableError(f"a worker cannot begin: {text} ({help})", help=help) from error
        what = "its node is gone" if isinstance(error, ray.exceptions.NodeDiedError) else str(error).split("\n")[0]
        self._failed(worker, SyntableError(f"a worker is lost: {what}", temporary=True), worker.place)

    def _failed(self, worker: Worker, error: SyntableError, place: str) -> None:
        """Ends the run if every worker would fail, and lets the worker start again if that may help."""
        self._last_error = error
        if isinstance(error, (RecipeError, Unfit)):
            if place and hasattr(error, "add_note"):
                error.add_note(f"on {place}")
            raise error
        worker.failures += 1
        pause = min(PAUSE_S * 2 ** (worker.failures - 1), LONGEST_PAUSE_S)
        again = error.temporary and worker.failures < FAILURES
        if again:
            worker.due = time.monotonic() + pause
            self._waiting.append(worker)
        if again:
            then = f"starts again in {pause:.0f} s"
        else:
            then = f"is given up after {worker.failures} failures" if error.temporary else "is given up"
        message = f"worker {worker.number} on {place or 'a new node'} {then}: {error}"
        self._heard({"event": "message", "level": "warning", "message": message})

    def _listen(self, patience: float = 0.0) -> None:
        """Passes the events of workers on."""
        if self._letter is None:
            self._letter = self._mailbox.take.remote()
        # The mailbox starts again where its node is lost; the events in it are lost, too.
        if not ray.wait([self._letter], timeout=patience)[0]:
            return
        letter, self._letter = self._letter, None
        try:
            events = ray.get(letter)
        except ray.exceptions.RayError:
            return
        for number, event in events:
            worker = self._workers[number]
            if event["event"] == "worker":
                worker.place = event["place"]
            elif event["event"] == "scene":
                worker.failures = 0
            for one in self._seen.new(event, self._order.threads * len(self._workers)):
                self._heard(one)

    def _wait(self) -> None:
        """Waits for the other workers, which find the end of the run. Those that have not begun need not."""
        idle = [task for task, worker in self._running.items() if not worker.place]
        self._cancel(idle, force=False)
        end = time.monotonic() + RETURN_S
        while self._running and time.monotonic() < end:
            ended, _ = ray.wait(list(self._running), timeout=POLL_S)
            self._listen()
            for task in ended:
                self._running.pop(task)
                try:
                    report = ray.get(task)
                except ray.exceptions.RayError:
                    continue
                if report.outcome is not None:
                    self._outcomes.append(report.outcome)
        # The first letter may be older than the last events.
        for _ in range(2):
            self._listen(ARRIVE_S)
        if self._running:
            self._stop()

    def _stop(self) -> None:
        """Ends all workers: an interrupt lets them give their claims back. A second Ctrl-C kills them."""
        tasks = list(self._running)
        try:
            self._cancel(tasks, force=False)
            if tasks:
                _, tasks = ray.wait(tasks, num_returns=len(tasks), timeout=STOP_S)
        finally:
            self._cancel(tasks, force=True)
        if tasks:
            ray.wait(tasks, num_returns=len(tasks), timeout=STOP_S)

    @staticmethod
    def _cancel(tasks: list[Any], force: bool) -> None:
        for task in tasks:
            ray.cancel(task, force=force)

    def _end(self) -> Outcome:
        """The dataset after the run. Only the worker that ended the run knows all that went wrong."""

        def together(lists: list[list[str]]) -> list[str]:
            return list(dict.fromkeys(text for each in lists for text in each))

        outcome = replace(
            self._outcomes[0],
            lacking=max(outcome.lacking for outcome in self._outcomes),
            useless=together([outcome.useless for outcome in self._outcomes]),
            bad_assets=together([outcome.bad_assets for outcome in self._outcomes]),
            left_out=together([outcome.left_out for outcome in self._outcomes]),
        )
        if self._seen.stages:
            self._heard({"event": "stages", "stages": self._seen.stages})
        self._heard(
            {
                "event": "finished",
                "out": outcome.path,
                "scenes": outcome.scenes,
                "failed": outcome.failed,
                "images": outcome.images,
                "made": self._seen.made,
                "grown": 0,
                "seconds": time.monotonic() - self._start,
            }
        )
        return outcome


class Seen:
    """The events of all workers as those of one run: each image, scene and message once.

    Attributes:
        made: Number of images that were made.
        stages: Times of the stages, over all workers.
    """

    def __init__(self) -> None:
        self.made = 0
        self.stages: dict[str, dict[str, Any]] = {}
        #: Made views of the scenes that are not done, as bits: a dataset may have millions of images.
        self._views: dict[int, int] = {}
        #: Whether each scene is done.
        self._done = bytearray()
        self._others: set[str] = set()

    def new(self, event: Event, threads: int) -> list[Event]:
        """The event, if it is new for the listener."""
        kind = event["event"]
        if kind == "image":
            return [event] if self._is_new_image(event["scene"], event["view"]) else []
        if kind == "scene":
            return [event] if self._is_new_scene(event["scene"]) else []
        if kind == "stages":
            for name, times in event["stages"].items():
                known = self.stages.setdefault(name, dict.fromkeys(times, 0))
                for key, value in times.items():
                    known[key] = known.get(key, 0) + value
            return []
        if kind in ("worker", "finished"):
            return []
        if kind == "working":
            return [event]
        # All workers begin, and warn of the same recipe.
        key = kind if kind == "started" else repr(sorted(event.items()))
        if key in self._others:
            return []
        self._others.add(key)
        return [{**event, "threads": threads} if kind == "started" else event]

    def _is_new_image(self, scene: int, view: int) -> bool:
        views = self._views.get(scene, 0)
        # A lost worker's scene is made again.
        if self._is_done(scene) or views >> view & 1:
            return False
        self._views[scene] = views | 1 << view
        self.made += 1
        return True

    def _is_new_scene(self, scene: int) -> bool:
        if self._is_done(scene):
            return False
        self._done.extend(bytes(max(0, scene + 1 - len(self._done))))
        self._done[scene] = True
        self._views.pop(scene, None)
        return True

    def _is_done(self, scene: int) -> bool:
        return scene < len(self._done) and bool(self._done[scene])
