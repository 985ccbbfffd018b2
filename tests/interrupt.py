"""Kills commands at every call that changes files, and lets every call fail, then runs the same command again.

    python3 interrupt.py SYNTABLE DATASET [--threads N] [--only COMMAND] [--short | --every N] [--reads-every N]

Needs strace. DATASET is a small dataset of `syntable run`. Whatever happens, the place of the result has what was there before or
all of what is new, and the same command once more gives the right result with nothing beside it. A command whose call fails
ends with an error, or has the right result. Prints how many calls were tried of each kind.

The short form tries of each command and each of KINDS one call that concerns the result: it kills the command there, and lets the
call fail. A command that makes no call of a kind, and a fault that reaches no call, are mistakes of the trial.
"""

import argparse
import collections
import concurrent.futures
import filecmp
import os
import re
import shutil
import subprocess
import sys
import tempfile

# Calls that change files, and those that read what they need to know for it.
CHANGING = ["mkdir", "rename", "renameat", "renameat2", "unlink", "unlinkat", "rmdir", "linkat", "link", "write", "fsync", "fdatasync", "flock", "chmod", "fchmod", "ftruncate", "openat"]
READING = ["read", "pread64", "statx", "fstat", "newfstatat", "getdents64", "readlink"]
# What the short form tries.
KINDS = {
    "open": ["openat"],
    "write": ["write"],
    "fsync": ["fsync", "fdatasync"],
    "rename": ["rename", "renameat", "renameat2"],
    "unlink": ["unlink", "unlinkat"],
}


def tree(path):
    """All files below a path with their bytes."""
    if os.path.isfile(path):
        return {"": open(path, "rb").read()}
    found = {}
    for folder, _, names in os.walk(path):
        for name in names:
            full = os.path.join(folder, name)
            found[os.path.relpath(full, path)] = open(full, "rb").read()
    return found


class Trial:
    """A command whose result goes to `out`; `before` is what stands there."""

    def __init__(self, name, home, command, before=None, again=None, refuses=False):
        self.name, self.home, self.command, self.before = name, home, command, before
        # What replaces an incomplete result.
        self.again = again or command
        # Whether the command refuses a place that has a result.
        self.refuses = refuses
        self.out = os.path.join(home, "out")
        # Exit codes, and what stood at the place after the fault.
        self.outcomes = collections.Counter()
        # Faults that reached no call.
        self.missed = 0

    def reset(self):
        for name in os.listdir(self.home):
            path = os.path.join(self.home, name)
            shutil.rmtree(path) if os.path.isdir(path) else os.remove(path)
        if self.before and os.path.isdir(self.before):
            shutil.copytree(self.before, self.out)
        elif self.before:
            shutil.copy(self.before, self.out)

    def run(self, command, trace=()):
        return subprocess.run([*trace, *command], stdin=subprocess.DEVNULL, capture_output=True, text=True)

    def calls(self):
        """How often a thread makes each call, at most; and of each kind, the calls that concern the result, with their numbers."""
        self.reset()
        with tempfile.NamedTemporaryFile("r") as log:
            done = self.run(self.command, ["strace", "-f", "-y", "-qq", "-o", log.name, "-e", "trace=" + ",".join(CHANGING + READING)])
            assert done.returncode == 0, done.stderr
            lines = log.read().splitlines()
        self.wanted = tree(self.out)
        assert not self.before or tree(self.before) != self.wanted, "the result is what stood there before"
        assert os.listdir(self.home) == ["out"], os.listdir(self.home)
        counts, concerned = collections.Counter(), {kind: [] for kind in KINDS}
        for line in lines:
            found = re.match(r"(\d+) +(\w+)\(", line)
            if not found:
                continue
            counts[found.groups()] += 1
            call = found[2]
            if self.home in line and (call != "openat" or re.search("O_CREAT|O_WRONLY|O_RDWR", line)):
                for kind, calls in KINDS.items():
                    concerned[kind] += [(call, counts[found.groups()])] * (call in calls)
        most = {}
        for (_, call), count in counts.items():
            most[call] = max(most.get(call, 0), count)
        return most, concerned

    def check(self, what, fault):
        """Injects a fault, and returns what was wrong, if anything."""
        self.reset()
        old = tree(self.out)
        call, number = what
        with tempfile.NamedTemporaryFile("r") as log:
            trace = ["strace", "-f", "-o", log.name, "-e", f"trace={call}", "-e", f"inject={call}:{fault}:when={number}"]
            done = self.run(self.command, trace)
            # Threads share the calls differently each time.
            self.is_reached = re.search(r"\(INJECTED\)|\+\+\+ killed by SIGKILL", log.read()) is not None
        self.missed += not self.is_reached
        now, kills = tree(self.out), fault.startswith("signal")
        state = "new" if now == self.wanted else "old" if now == old else "incomplete"
        self.outcomes[f"{fault} code {done.returncode} {state}"] += 1
        if now not in (old, self.wanted) and not (done.returncode == 3 and done.stderr):
            return f"neither the old nor the new result (code {done.returncode}): {done.stderr}"
        if not kills and done.returncode == 0 and now != self.wanted:
            return "the command says that all is well, and the result is another"
        if not kills and done.returncode not in (0, 127) and not done.stderr.strip() and call != "write":
            return f"code {done.returncode} without a word"
        # Incomplete results are replaced as the user would do it.
        again = self.again if done.returncode == 3 else self.command
        done = self.run(again)
        is_refused = self.refuses and now == self.wanted and done.returncode == 2
        if done.returncode != 0 and not is_refused:
            return f"the same command fails (code {done.returncode}): {done.stderr}"
        if tree(self.out) != self.wanted:
            return "the same command gives another result"
        if os.listdir(self.home) != ["out"]:
            return f"left: {os.listdir(self.home)}"
        return None


    def short(self):
        """Tries one call of each kind with each fault. Returns what was tried, and what was wrong."""
        _, concerned = self.calls()
        tried, wrong = collections.Counter(), []
        for kind, calls in concerned.items():
            if not calls:
                wrong.append(f"{self.name} makes no call of the kind {kind}")
            # Killed in the middle of the work; an error comes at the end of it.
            for fault, place in [("signal=KILL", len(calls) // 2), ("error=EIO", len(calls) - 1)]:
                while calls:
                    said = self.check(calls[place], fault)
                    if said:
                        wrong.append(f"{self.name}, {fault} at {calls[place]}: {said}")
                    if self.is_reached:
                        tried[f"{kind} {fault}"] += 1
                        break
                    if place == 0:
                        wrong.append(f"{self.name}, {fault} at {calls[place]} reaches no call")
                        break
                    place //= 2
        return tried, wrong

    def long(self, every, reads_every):
        """Tries all calls with all faults, or some of each. Returns what was tried, and what was wrong."""
        most, _ = self.calls()
        tried, wrong = collections.Counter(), []
        for fault, calls in [("signal=KILL", CHANGING), ("error=EIO", CHANGING + READING), ("error=ENOSPC", ["write", "fsync", "mkdir", "openat"])]:
            for call in calls:
                for number in range(1, most.get(call, 0) + 1, every * (reads_every if call in READING else 1)):
                    tried[fault] += 1
                    said = self.check((call, number), fault)
                    if said:
                        wrong.append(f"{self.name}, {fault} at {call} {number}: {said}")
                        print(wrong[-1], flush=True)
        return tried, wrong


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("syntable")
    parser.add_argument("dataset")
    parser.add_argument("--threads", default="1")
    parser.add_argument("--only")
    parser.add_argument("--short", action="store_true", help="try one call of each kind")
    parser.add_argument("--every", type=int, default=1, help="try one of N calls")
    parser.add_argument("--reads-every", type=int, default=1, help="of calls that only read, try one of N")
    args = parser.parse_args()
    base = tempfile.mkdtemp()
    homes = [os.path.join(base, f"home{number}") for number in range(4)]
    outs = [os.path.join(home, "out") for home in homes]
    for home in homes:
        os.mkdir(home)
    threads = ["--threads", args.threads]
    old_report, old_scores = os.path.join(base, "report"), os.path.join(base, "scores")
    report = [args.syntable, "report", args.dataset, *threads, "--out"]
    evaluate = [args.syntable, "eval", "--gt", args.dataset, "--pred", args.dataset, *threads, "--save"]
    subprocess.run([*report, old_report, "--images", "1"], check=True, capture_output=True)
    subprocess.run([*evaluate, old_scores, "--worst", "1"], check=True, capture_output=True)
    convert = [args.syntable, "convert", args.dataset, "--to", "coco,png", "--out", outs[2]]
    trials = [
        Trial("report", homes[0], [*report, outs[0]], again=[*report, outs[0], "--overwrite"], refuses=True),
        Trial("report --overwrite", homes[1], [*report, outs[1], "--overwrite"], before=old_report),
        Trial("convert", homes[2], convert, again=["sh", "-c", 'rm -r "$0" && exec "$@"', outs[2], *convert], refuses=True),
        Trial("eval --save", homes[3], [*evaluate, outs[3]], before=old_scores),
    ]
    trials = [trial for trial in trials if args.only in (None, trial.name)]
    wrong = []
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        try_one = (lambda trial: trial.short()) if args.short else (lambda trial: trial.long(args.every, args.reads_every))
        for trial, (tried, found) in zip(trials, pool.map(try_one, trials)):
            wrong += found
            print(f"{trial.name}: {dict(tried)}, {trial.missed} reached no call; {dict(sorted(trial.outcomes.items()))}", flush=True)
    shutil.rmtree(base)
    for line in wrong:
        print(line)
    sys.exit(len(wrong) > 0)


main()
