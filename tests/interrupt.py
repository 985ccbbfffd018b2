"""Kills commands at every call that changes files, and lets every call fail, then runs the same command again.

    python3 interrupt.py SYNTABLE DATASET [--threads N] [--only COMMAND] [--every N] [--reads-every N]

Needs strace. DATASET is a small dataset of `syntable run`. Whatever happens, the place of the result has what was there before or
all of what is new, and the same command once more gives the right result with nothing beside it. A command whose call fails
ends with an error, or has the right result. Prints how many calls were tried of each kind.
"""

import argparse
import collections
import filecmp
import os
import re
import shutil
import subprocess
import sys
import tempfile

# Calls that change files, and those that read what they need to know for it.
CHANGING = ["mkdir", "rename", "renameat2", "unlink", "unlinkat", "rmdir", "linkat", "link", "write", "fsync", "flock", "chmod", "fchmod", "ftruncate", "openat"]
READING = ["read", "pread64", "statx", "fstat", "newfstatat", "getdents64", "readlink"]


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
        """How often a thread makes each call, at most."""
        self.reset()
        with tempfile.NamedTemporaryFile("r") as log:
            done = self.run(self.command, ["strace", "-f", "-qq", "-o", log.name, "-e", "trace=" + ",".join(CHANGING + READING)])
            assert done.returncode == 0, done.stderr
            counts = collections.Counter(re.findall(r"^(\d+) +(\w+)\(", log.read(), re.M))
        self.wanted = tree(self.out)
        assert os.listdir(self.home) == ["out"], os.listdir(self.home)
        most = {}
        for (_, call), count in counts.items():
            most[call] = max(most.get(call, 0), count)
        return most

    def check(self, what, fault):
        """Injects a fault, and returns what was wrong, if anything."""
        self.reset()
        old = tree(self.out)
        call, number = what
        trace = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={call}", "-e", f"inject={call}:{fault}:when={number}"]
        done = self.run(self.command, trace)
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


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("syntable")
    parser.add_argument("dataset")
    parser.add_argument("--threads", default="1")
    parser.add_argument("--only")
    parser.add_argument("--every", type=int, default=1, help="try one of N calls")
    parser.add_argument("--reads-every", type=int, default=1, help="of calls that only read, try one of N")
    args = parser.parse_args()
    base = tempfile.mkdtemp()
    home, out = os.path.join(base, "home"), os.path.join(base, "home", "out")
    os.mkdir(home)
    threads = ["--threads", args.threads]
    old_report, old_scores = os.path.join(base, "report"), os.path.join(base, "scores")
    report = [args.syntable, "report", args.dataset, *threads, "--out"]
    evaluate = [args.syntable, "eval", "--gt", args.dataset, "--pred", args.dataset, *threads, "--save"]
    subprocess.run([*report, old_report, "--images", "1"], check=True, capture_output=True)
    subprocess.run([*evaluate, old_scores, "--worst", "1"], check=True, capture_output=True)
    convert = [args.syntable, "convert", args.dataset, "--to", "coco,png", "--out", out]
    trials = [
        Trial("report", home, [*report, out], again=[*report, out, "--overwrite"], refuses=True),
        Trial("report --overwrite", home, [*report, out, "--overwrite"], before=old_report),
        Trial("convert", home, convert, again=["sh", "-c", 'rm -r "$0" && exec "$@"', out, *convert], refuses=True),
        Trial("eval --save", home, [*evaluate, out], before=old_scores),
    ]
    wrong = 0
    for trial in trials:
        if args.only and trial.name != args.only:
            continue
        most, tried = trial.calls(), collections.Counter()
        for fault, calls in [("signal=KILL", CHANGING), ("error=EIO", CHANGING + READING), ("error=ENOSPC", ["write", "fsync", "mkdir", "openat"])]:
            for call in calls:
                for number in range(1, most.get(call, 0) + 1, args.every * (args.reads_every if call in READING else 1)):
                    tried[fault] += 1
                    said = trial.check((call, number), fault)
                    if said:
                        wrong += 1
                        print(f"{trial.name}, {fault} at {call} {number}: {said}", flush=True)
        print(f"{trial.name}: {dict(tried)}; {dict(sorted(trial.outcomes.items()))}", flush=True)
    shutil.rmtree(base)
    sys.exit(wrong > 0)


main()
