//! Jobs on a cluster: the files of `syntable new slurm`, `new kubernetes` and `new skypilot` with the real schedulers' programs.

use crate::support::{assert_same, made, ok, small_run, syntable};
use std::fmt::Write;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use syntable_testing::tools::{skip, skip_slow_tool};

/// A Slurm cluster of two nodes on this machine. Its programs end with it.
pub struct Cluster {
    folder: PathBuf,
    daemons: Vec<Child>,
}

const SLURM_CONF: &str = "ClusterName=test
SlurmctldHost=localhost(127.0.0.1)
AuthType=auth/munge
AuthInfo=socket=@DIR@/munge.socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation=@DIR@/state
SlurmdSpoolDir=@DIR@/spool.%n
SlurmctldPidFile=@DIR@/slurmctld.pid
SlurmdPidFile=@DIR@/slurmd.%n.pid
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
SwitchType=switch/none
ReturnToService=2
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
PartitionName=all Nodes=ALL Default=YES MaxTime=10 State=UP
";

impl Cluster {
    /// Whether this machine has the daemons, and the rights that they need.
    pub fn is_installed() -> bool {
        let programs = ["munged", "slurmctld", "slurmd", "sbatch", "scancel"];
        let has = |name: &str| ["/usr/sbin", "/usr/bin"].iter().any(|folder| Path::new(folder).join(name).exists());
        let is_root = || Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.starts_with(b"0"));
        programs.iter().all(|name| has(name)) && is_root()
    }

    /// A cluster with its files in a folder.
    pub fn start(folder: &Path) -> Self {
        let free = || TcpListener::bind("127.0.0.1:0").and_then(|it| it.local_addr()).expect("a free port").port();
        let mut conf = SLURM_CONF.replace("@DIR@", &folder.display().to_string());
        writeln!(conf, "SlurmctldPort={}\nSlurmdPort={}", free(), free()).expect("memory");
        for node in ["n1", "n2"] {
            let port = free();
            writeln!(
                conf,
                "NodeName={node} NodeHostname=localhost NodeAddr=127.0.0.1 Port={port} CPUs=1 RealMemory=1000"
            )
            .expect("memory");
            fs::create_dir_all(folder.join(format!("spool.{node}"))).expect("a folder");
        }
        fs::create_dir_all(folder.join("state")).expect("a folder");
        fs::write(folder.join("slurm.conf"), conf).expect("writable");
        let key = folder.join("munge.key");
        fs::write(&key, [42; 1024]).expect("writable");
        ok(Command::new("chmod").arg("400").arg(&key));
        let mut cluster = Self { folder: folder.to_owned(), daemons: Vec::new() };
        let at = |name: &str, value: &str| format!("--{name}={}", folder.join(value).display());
        cluster.daemon(
            "munged",
            &[
                "--foreground",
                "--force",
                &at("socket", "munge.socket"),
                &at("key-file", "munge.key"),
                &at("pid-file", "munge.pid"),
                &at("log-file", "munge.log"),
                &at("seed-file", "munge.seed"),
            ],
        );
        until("munge listens", || folder.join("munge.socket").exists());
        cluster.daemon("slurmctld", &["-D", "-c"]);
        ["n1", "n2"].iter().for_each(|node| cluster.daemon("slurmd", &["-D", "-N", node]));
        until("two nodes are idle", || cluster.says("sinfo", &["--noheader", "--format", "%T %D"]).trim() == "idle 2");
        cluster
    }

    /// Makes the dataset of `recipe.toml` in the cluster's folder, as an array of shards. One task is killed after its first
    /// scene, and Slurm starts it again.
    pub fn array(&self, out: &Path, shards: u32) {
        fs::create_dir(self.folder.join("bin")).expect("a folder");
        #[cfg(unix)]
        std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_syntable-under-test"), self.folder.join("bin/syntable"))
            .expect("a link");
        let script = self.folder.join("job.sbatch");
        let mut new = syntable();
        new.current_dir(&self.folder).args(["new", "slurm"]).arg(&script);
        ok(new.args(["--shards", &shards.to_string(), "--out"]).arg(out));
        let text = fs::read_to_string(&script).expect("there");
        let small = text.replace("--cpus-per-task=8", "--cpus-per-task=1").replace("--mem=16G", "--mem=500M");
        fs::write(&script, small.replace("--time=04:00:00", "--time=5")).expect("writable");
        ok(self.command("bash").arg(&script));
        let parts = out.with_extension("shards");
        let journal = parts.join(format!("1-of-{shards}/.syntable/journal.jsonl"));
        let lines = || fs::read_to_string(&journal).unwrap_or_default().lines().count();
        until("the task has a scene", || lines() > 0);
        let array = self.says("squeue", &["--noheader", "--array", "--name", "syntable", "--format", "%F_%K"]);
        let task = array.lines().find(|line| line.ends_with("_1")).unwrap_or_else(|| panic!("{array}"));
        ok(self.command("scancel").args(["--signal=KILL", "--full", task]));
        // Slurm starts it again after two minutes.
        let queue = || self.says("squeue", &["--noheader", "--array", "--name", "syntable", "--format", "%F_%K %r"]);
        until("the task waits to start again", || queue().contains(&format!("{task} BeginTime")));
        let status = || {
            let output = syntable().arg("status").arg(&parts).output().expect("starts");
            (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
        };
        let (code, said) = status();
        let of_task = format!("1-of-{shards}");
        let line = said.lines().find(|line| line.contains(&of_task)).unwrap_or_else(|| panic!("{said}"));
        assert!(code == Some(3) && line.contains("stopped") && line.contains(" missing"), "{said}");
        ok(self.command("scontrol").args(["update", &format!("JobId={task}"), "StartTime=now"]));
        until("all jobs have ended", || self.says("squeue", &["--noheader"]).trim().is_empty());
        assert_eq!(status().0, Some(0), "{}", status().1);
    }

    fn daemon(&mut self, program: &str, arguments: &[&str]) {
        let log = fs::File::create(self.folder.join(format!("{program}.{}.out", self.daemons.len()))).expect("a log");
        let mut command = self.command(program);
        command.args(arguments).stdout(log.try_clone().expect("a log")).stderr(log).stdin(Stdio::null());
        self.daemons.push(command.spawn().expect("the daemon starts"));
    }

    /// A command on the cluster. Jobs find the program under its name.
    fn command(&self, program: &str) -> Command {
        let path = std::env::var("PATH").unwrap_or_default();
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.folder.join("slurm.conf"));
        command.env("PATH", format!("{}:{path}:/usr/sbin:/sbin", self.folder.join("bin").display()));
        command.current_dir(&self.folder);
        command
    }

    fn says(&self, program: &str, arguments: &[&str]) -> String {
        let output = self.command(program).args(arguments).output().expect("the program starts");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

fn until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_secs(120), "not within two minutes: {what}");
        thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_slurm_array_that_loses_a_task_makes_the_dataset_of_one_run() {
    if !Cluster::is_installed() {
        return skip_slow_tool("Slurm, with munge and as root");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, out) = (folder.path().join("whole"), folder.path().join("mine"));
    made(&mut small_run(&whole, &["--set", "dataset.scenes=9"]));
    fs::copy(whole.join("recipe.toml"), folder.path().join("recipe.toml")).expect("there");
    let cluster = Cluster::start(folder.path());
    cluster.array(&out, 3);
    drop(cluster);
    assert_same(&whole, &out);
}

#[test]
fn kubernetes_accepts_the_job() {
    let folder = tempfile::tempdir().expect("a folder");
    let job = folder.path().join("job");
    let new = |out: &str| {
        let mut command = syntable();
        command.args(["new", "kubernetes"]).arg(&job).args(["--recipe", "builtin:quickstart", "--shards", "7"]);
        command.args(["--out", out]);
        command
    };
    let lost = new("data/mine").output().expect("starts");
    assert!(lost.status.code() == Some(2) && !job.exists(), "{}", crate::support::text(&lost));
    ok(&mut new("/data/a \"b\""));
    for name in ["Dockerfile", ".dockerignore"] {
        assert!(job.join(name).exists(), "{name}");
    }
    let validate = |manifest: &Path| {
        let mut command = Command::new("kubernetes-validate");
        command.arg("--strict").arg(manifest).output()
    };
    let manifest = job.join("job.yaml");
    let Ok(output) = validate(&manifest) else { return skip("kubernetes-validate") };
    assert!(output.status.success(), "{}", crate::support::text(&output));
    let misspelt = fs::read_to_string(&manifest).expect("there").replace("completionMode", "completionMod");
    fs::write(&manifest, misspelt).expect("writable");
    assert!(validate(&manifest).is_ok_and(|output| !output.status.success()));
}

#[test]
fn skypilot_accepts_the_task() {
    let folder = tempfile::tempdir().expect("a folder");
    let task = folder.path().join("job.yaml");
    let out = ["--recipe", "builtin:quickstart", "--out", "s3://bucket/it's mine", "--workers", "7"];
    ok(syntable().args(["new", "skypilot"]).arg(&task).args(out));
    let validate = || {
        let code = "import sys, sky; task = sky.Task.from_yaml(sys.argv[1]); print(task.run, task.resources)";
        let mut command = Command::new("skypilot-python");
        // It keeps its state at home.
        command.args(["-c", code]).arg(&task).env("HOME", folder.path()).current_dir(folder.path()).output()
    };
    let Ok(output) = validate() else { return skip_slow_tool("skypilot-python, which has SkyPilot") };
    let shown = crate::support::text(&output);
    assert!(output.status.success() && shown.contains("s3://bucket/it") && shown.contains("[Spot]"), "{shown}");
    let misspelt = fs::read_to_string(&task).expect("there").replace("use_spot", "use_spots");
    fs::write(&task, misspelt).expect("writable");
    assert!(validate().is_ok_and(|output| !output.status.success()));
}
