"""Tests batch --slurm with Debian's Slurm: munged, slurmctld and slurmd on this machine's loopback,
with a configuration of their own. Skipped where they are not installed or cannot run."""

import json
import os
import re
import shutil
import socket
import subprocess
import time

import pytest

import harness
from batch_test import QUICK, make_data, options_of, pattern, summary, write_table  # noqa: F401

PROJECT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# The options of QUICK that have a value, as columns of a table.
QUICK_VALUES = {flag[2:]: value for flag, value in zip(QUICK, QUICK[1:])
                if str(flag).startswith("--") and flag != "--no-margin"}
DAEMONS = ["munged", "slurmctld", "slurmd"]
PATH = os.environ["PATH"] + ":/usr/sbin"

CONFIGURATION = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerParameters=sched_interval=1,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
MailProg=/bin/true
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs=8 RealMemory=2000
PartitionName=cpu Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Cluster:
    """Runs the daemons of a cluster with one node."""

    def __init__(self, folder):
        self.folder = folder
        self.environment = {**os.environ, "PATH": PATH,
                            "SLURM_CONF": os.path.join(folder, "slurm.conf")}
        self.running = []
        for name in ("state", "spool"):
            os.makedirs(os.path.join(folder, name))
        with open(self.environment["SLURM_CONF"], "w", encoding="utf-8") as file:
            file.write(CONFIGURATION.format(host=socket.gethostname().split(".")[0],
                                            folder=folder, ports=free_ports(2)))
        key = os.path.join(folder, "munge.key")
        with open(key, "wb") as file:
            file.write(os.urandom(128))
        os.chmod(key, 0o600)
        self.start("munged", "--foreground", "--force", "--key-file=" + key,
                   f"--socket={folder}/munge.socket", f"--pid-file={folder}/munged.pid",
                   f"--log-file={folder}/munged.log", f"--seed-file={folder}/munged.seed")
        self.start("slurmctld", "-D")
        self.start("slurmd", "-D")

    def start(self, *command):
        log = open(os.path.join(self.folder, command[0] + ".out"), "wb")
        self.running.append(subprocess.Popen(command, stdout=log, stderr=log,
                                             env=self.environment))

    def run(self, *command):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True)

    def is_ready(self):
        return "idle" in self.run("sinfo", "--noheader", "--format=%T").stdout

    def jobs(self):
        """Returns the number of tasks that wait or run."""
        return len(self.run("squeue", "--noheader", "--array").stdout.splitlines())

    def wait_for_jobs(self, seconds=60):
        end = time.monotonic() + seconds
        while self.jobs() > 0:
            assert time.monotonic() < end, self.run("squeue").stdout
            time.sleep(0.1)

    def stop(self):
        self.run("scancel", "--user=root")
        for process in reversed(self.running):
            process.terminate()
        for process in reversed(self.running):
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


@pytest.fixture(scope="module", name="cluster")
def make_cluster():
    missing = [name for name in [*DAEMONS, "sbatch"] if not shutil.which(name, path=PATH)]
    if missing:
        pytest.skip(f"Slurm is not installed: {', '.join(missing)}")
    if os.geteuid() != 0:
        pytest.skip("slurmd needs root")
    cluster = Cluster(harness.fresh_directory("cluster"))
    try:
        for _ in range(200):
            if cluster.is_ready():
                break
            if any(process.poll() is not None for process in cluster.running):
                break
            time.sleep(0.05)
        if not cluster.is_ready():
            logs = "\n".join(harness.read_bytes(os.path.join(cluster.folder, name + ".out")).decode()
                             for name in DAEMONS)
            pytest.skip(f"Slurm's daemons cannot run here:\n{logs}")
        yield cluster
    finally:
        cluster.stop()


def submit(cluster, folder, *arguments):
    """Submits a batch and returns the number of its job."""
    said = harness.succeed("batch", "--slurm", "--sbatch=--mem=300M", *arguments, "-o", folder,
                           "--threads", 1, env=cluster.environment)
    return re.search(r"Slurm job (\d+)", said.stdout).group(1)


def test_every_series_is_a_task_and_a_failure_stops_none(cluster, data):
    folder = harness.fresh_directory("array")
    submit(cluster, folder, *pattern(data), *QUICK)
    with open(os.path.join(folder, "batch.sbatch"), encoding="utf-8") as file:
        script = file.read()
    assert "--array=1,2,3" in script and "--cpus-per-task=1" in script
    cluster.wait_for_jobs()
    lines = summary(folder)
    assert [lines[name]["state"] for name in "abc"] == ["done", "done", "failed"], lines
    assert "section 3" in lines["c"]["reason"]
    assert "on 1 thread" in harness.read_bytes(os.path.join(folder, "logs", "a.log")).decode()
    submit(cluster, folder, *pattern(data), *QUICK, "--exclude", 3, "--skip-existing")
    with open(os.path.join(folder, "batch.sbatch"), encoding="utf-8") as file:
        assert "--array=3\n" in file.read()
    cluster.wait_for_jobs()
    assert [summary(folder)[name]["state"] for name in "abc"] == ["skipped", "skipped", "done"]


def test_one_task_chooses_for_all_series_before_they_run(cluster, data):
    folder = harness.fresh_directory("choosing")
    table = write_table(os.path.join(folder, "list.csv"), [["stack", "tlt"], *(
        [os.path.join(data, name + ".mrc"), os.path.join(data, name + ".tlt")] for name in "ab")])
    at = QUICK.index("--tv-penalty")
    submit(cluster, folder, table, *QUICK[:at], *QUICK[at + 2:])
    cluster.wait_for_jobs()
    with open(os.path.join(folder, "choice.json"), encoding="utf-8") as file:
        choice = json.load(file)
    assert [vote["series"] for vote in choice["votes"]] == ["a", "b"]
    for name in "ab":
        assert summary(folder)[name]["state"] == "done"
        fit = options_of(os.path.join(folder, name + ".mrc"))["fit"]
        assert [fit["penalty"], fit["density_variation"]] == [choice["tv_penalty"], choice["tv"]]


def test_the_example_of_the_documentation_runs(cluster, data):
    folder = harness.fresh_directory("example")
    table = [["stack", "tlt", "no-margin", *QUICK_VALUES]]
    for name in "ab":
        table.append([os.path.join(data, name + ".mrc"), os.path.join(data, name + ".tlt"), "true",
                      *QUICK_VALUES.values()])
    write_table(os.path.join(folder, "series.csv"), table)
    page = harness.read_bytes(os.path.join(PROJECT, "docs", "batch.md")).decode()
    example, = (block for block in re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
                if "--slurm" in block)
    environment = {**cluster.environment, "PATH": os.path.dirname(harness.PROGRAM) + ":" + PATH}
    subprocess.run(["sh", "-e", "-c", example], cwd=folder, env=environment, check=True)
    cluster.wait_for_jobs()
    lines = summary(os.path.join(folder, "results"))
    assert [lines[name]["state"] for name in "ab"] == ["done", "done"], lines
    assert "8 threads" in harness.read_bytes(
        os.path.join(folder, "results", "logs", "a.log")).decode()


def test_a_task_gets_no_more_memory_than_slurm_grants(cluster, data):
    folder = harness.fresh_directory("memory")
    submit(cluster, folder, os.path.join(data, "a.mrc"), *pattern(data)[1:], *QUICK,
           "--sbatch=--mem=8M")
    cluster.wait_for_jobs()
    line = summary(folder)["a"]
    assert line["state"] == "failed" and "SLURM_MEM_PER_NODE" in line["reason"]


def test_a_task_near_its_time_limit_goes_on_in_another(cluster, data):
    """Slurm looks at time limits every half minute, so scancel sends the task the signal that it
    gets then."""
    folder = harness.fresh_directory("limit")
    job = submit(cluster, folder, os.path.join(data, "a.mrc"), *pattern(data)[1:],
                 *harness.merge(QUICK, ["--epochs", 200]))
    log = os.path.join(folder, "logs", "a.log")

    def wait_for(text):
        end = time.monotonic() + 30
        while not os.path.exists(log) or text not in harness.read_bytes(log):
            assert time.monotonic() < end, text
            time.sleep(0.02)

    wait_for(b"reconstruct ")  # a step is done
    cluster.run("scancel", "--batch", "--signal=USR1", job)
    wait_for(b"resuming")
    cluster.wait_for_jobs()
    said = harness.read_bytes(os.path.join(folder, "logs", f"slurm-{job}_1.out")).decode()
    assert re.search(r"Slurm job (\d+) goes on", said).group(1) != job
    assert summary(folder)["a"]["state"] == "done"
