"""What a stranger reaches of a sweep that runs: another user of this machine, or who gave a file or results."""

import http.client
import json
import os
import subprocess
import sys

import psutil
import pytest
import yaml
from support.sweep_programs import STRIP, address_in, end, start_scheduler, start_worker

from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.studies.sweeps.run_sweep import read_sweep, sweep

WORKERS = 1
STRANGER = """
import asyncio, json, os, sys
from distributed import Client, Security, rpc

async def asked(address, security):
    async with rpc(address, connection_args=security.get_connection_args("client"), timeout=4) as node:
        return await node.identity()

async def ran(address, security):
    async with Client(address, asynchronous=True, timeout=4, security=security, set_as_default=False) as client:
        return await client.run_on_scheduler(os.getuid)

async def attempts(ports):
    tasks = [
        asyncio.create_task(attempt(f"{protocol}://127.0.0.1:{port}", security), name=f"{attempt.__name__} {port}")
        for protocol, security in (("tcp", Security()), ("tls", Security.temporary()))
        for port in ports
        for attempt in (asked, ran)
    ]
    done, _ = await asyncio.wait(tasks, timeout=12)
    print(*[task.get_name() for task in done if task.exception() is None], sep=", ", flush=True)
    os._exit(0)

if os.getuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
asyncio.run(attempts(json.loads(sys.argv[1])))
"""
"""Tries to talk to Dask's nodes at ports, and to have them run a function; prints which attempts succeeded."""


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """A sweep that runs: its program and all processes that it has started, and its folder of temporary files."""
    folder = tmp_path_factory.mktemp("running")
    content = STRIP | {"metrics": {"never": {"function": "own.py:sleep"}}}
    (folder / "own.py").write_text("import time\ndef sleep(run):\n    time.sleep(1000.0)\n")
    (folder / "sweep.yaml").write_text(yaml.safe_dump(content))
    temporary = folder / "temporary"
    temporary.mkdir()
    program = subprocess.Popen(
        [sys.executable, "-m", "bilayer_core", "sweep", "sweep.yaml", "--workers", str(WORKERS), "--out", "out"],
        cwd=folder,
        env=os.environ | {"TMPDIR": str(temporary)},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert program.stderr.readline().startswith("one process of this machine, 1 runs side by side")
        yield [psutil.Process(program.pid), *psutil.Process(program.pid).children(recursive=True)], temporary
    finally:
        end([program])


@pytest.fixture(scope="module")
def ports(running):
    """Ports that the processes listen at."""
    sockets = [of for process in running[0] for of in process.net_connections() if of.status == psutil.CONN_LISTEN]
    assert {of.laddr.ip for of in sockets} == {"127.0.0.1"}
    return sorted(of.laddr.port for of in sockets)


def test_processes_of_a_sweep_refuse_who_has_not_their_certificate(ports):
    command = [sys.executable, "-c", STRANGER, json.dumps(ports)]
    stranger = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (stranger.returncode, stranger.stdout) == (0, "\n"), stranger.stdout + stranger.stderr


def test_processes_of_a_sweep_listen_for_each_other_alone_and_serve_no_http(ports):
    assert len(ports) == 1 + 2 * WORKERS  # the scheduler; each worker, and the process that watches it
    for port in ports:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=3.0)
        connection.request("GET", "/")
        with pytest.raises((http.client.HTTPException, OSError)):
            connection.getresponse()


def test_the_key_of_a_sweep_is_in_no_file_command_line_or_environment(running):
    processes, temporary = running
    for process in processes:
        assert "PRIVATE KEY" not in " ".join([*process.cmdline(), *process.environ().values()])
    for path in temporary.rglob("*"):
        assert path.is_dir() or b"PRIVATE KEY" not in path.read_bytes()


@pytest.mark.parametrize("package", ["cryptography", "distributed"])
def test_a_missing_package_is_named_with_its_extra(strip, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf"{package} is not installed; .*: pip install 'bilayer_sim_ros\[sweep\]'"):
        sweep(strip, workers=1)


def test_a_dashboard_without_bokeh_is_refused_with_what_to_install(strip, monkeypatch):
    monkeypatch.setitem(sys.modules, "bokeh", None)
    with pytest.raises(InputError, match="--dashboard: bokeh is not installed; .*: pip install bokeh"):
        sweep(strip, workers=1, dashboard=True)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--dashboard", "--scheduler", "tls://a:1"), "--dashboard is for processes of this machine"),
        (("--tls-cert", "cert.pem"), "--tls-ca-file, --tls-cert and --tls-key are for a cluster"),
    ],
)
def test_options_that_contradict_each_other_are_refused(tmp_path, capsys, arguments, told):
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(STRIP))
    assert main(["sweep", str(tmp_path / "sweep.yaml"), *arguments]) == 2
    assert told in capsys.readouterr().err


# Certificates


def pem_files(folder):
    """Options for files with a new key and its certificate, which is its own authority."""
    from distributed import Security

    made = Security.temporary()
    texts = {"ca-file": made.tls_ca_file, "cert": made.tls_client_cert, "key": made.tls_client_key}
    for name, text in texts.items():
        (folder / f"{name}.pem").write_text(text)
    return [word for name in texts for word in (f"--tls-{name}", str(folder / f"{name}.pem"))]


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    """Address of a scheduler with a worker, both of which want certificates, and the options that have them."""
    folder = tmp_path_factory.mktemp("closed")
    certificates = pem_files(folder)
    processes = [start_scheduler(folder / "scheduler.json", "--protocol", "tls", *certificates)]
    address = address_in(folder / "scheduler.json")
    processes.append(start_worker(address, folder, "--host", "tls://127.0.0.1", *certificates))
    from distributed import Client, Security

    names = "tls_ca_file", "tls_client_cert", "tls_client_key"
    security = Security(**dict(zip(names, certificates[1::2], strict=True)))
    with Client(address, security=security, set_as_default=False) as client:
        client.wait_for_workers(1, timeout=60)
    yield address, certificates
    end(processes[::-1])


@pytest.fixture
def call(tmp_path, capsys):
    """Runs `bilayer sweep` on a cluster; exit code, and standard error."""
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(STRIP))

    def run(*arguments):
        code = main(["sweep", str(tmp_path / "sweep.yaml"), "--out", str(tmp_path / "out"), *arguments])
        return code, capsys.readouterr().err

    return run


@pytest.mark.slow
def test_a_sweep_runs_on_a_cluster_that_wants_certificates(call, closed):
    address, certificates = closed
    assert address.startswith("tls://")
    code, told = call("--scheduler", address, *certificates)
    assert code == 0
    assert told.startswith(f"cluster {address}, 1 runs side by side\n") and "warning" not in told


@pytest.mark.slow
def test_certificates_may_come_from_the_configuration_of_dask(call, closed, tmp_path):
    import dask

    address, (_, ca_file, _, cert, _, key) = closed
    names = {"ca-file": ca_file, "client.cert": cert, "client.key": key}
    with dask.config.set({f"distributed.comm.tls.{name}": path for name, path in names.items()}):
        assert call("--scheduler", address)[0] == 0


@pytest.mark.slow
def test_a_cluster_refuses_certificates_of_another_authority(call, closed, tmp_path):
    code, told = call("--scheduler", closed[0], *pem_files(tmp_path))
    assert code == 2
    assert f"--scheduler: {closed[0]}: " in told and "certificate" in told and "Traceback" not in told


def test_files_that_are_no_certificates_are_told_by_option(call, tmp_path):
    right = pem_files(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    pem_files(other)
    (tmp_path / "junk.pem").write_text("junk")
    for option, path, told in (
        ("--tls-ca-file", tmp_path / "junk.pem", "has no certificate in PEM format"),
        ("--tls-cert", tmp_path / "junk.pem", "is no certificate in PEM format"),
        ("--tls-key", tmp_path / "junk.pem", "is no certificate in PEM format, or"),
        ("--tls-key", other / "key.pem", "is not the key of the certificate"),
        ("--tls-key", tmp_path / "absent.pem", "cannot be read: No such file or directory"),
        ("--tls-ca-file", tmp_path, "cannot be read: Is a directory"),
    ):
        words = list(right)
        words[words.index(option) + 1] = str(path)
        code, err = call("--scheduler", "tls://127.0.0.1:1", *words, "--force")
        assert code == 2 and told in err and str(path) in err and "Traceback" not in err


def test_a_key_with_a_pass_phrase_is_refused_and_nothing_is_asked(call, tmp_path):
    from cryptography.hazmat.primitives import serialization

    words = pem_files(tmp_path)
    key = serialization.load_pem_private_key((tmp_path / "key.pem").read_bytes(), None)
    encryption = serialization.BestAvailableEncryption(b"word")
    forms = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    (tmp_path / "key.pem").write_bytes(key.private_bytes(*forms, encryption))
    code, err = call("--scheduler", "tls://127.0.0.1:1", *words)
    assert code == 2 and "key.pem: is encrypted; Dask needs a key without a pass phrase" in err


def test_an_address_and_certificates_must_belong_together(call, tmp_path):
    code, err = call("--scheduler", "tls://127.0.0.1:1")
    assert code == 2 and "needs certificates; --tls-ca-file (or distributed.comm.tls.ca-file in Dask's" in err
    code, err = call("--scheduler", "tcp://127.0.0.1:1", *pem_files(tmp_path), "--force")
    assert code == 2 and "certificates need an address that begins with tls://" in err


# Sweep files and results of others

RUN_ME = "import pathlib\npathlib.Path(__file__).with_name('ran').touch()\ndef own(*given):\n    return given[0]\n"


@pytest.mark.parametrize(
    "hostile",
    [
        {"change": "own.py:own"},
        {"metrics": {"own": {"function": "own.py:own"}}},
        {"metrics": {"own": {"function": "own:own"}}},
        {"scene": "own.py"},
        {"scene": "scene.yaml"},
        {"title": "{{ lipsum.__globals__.os.system('touch ran') }}"},
        {"set": {"duration": "__import__('os').system('touch ran')"}},
    ],
    ids=lambda hostile: next(iter(hostile)),
)
def test_listing_a_hostile_sweep_file_executes_nothing(strip, tmp_path, monkeypatch, capsys, hostile):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own.py").write_text(RUN_ME)
    (tmp_path / "scene.yaml").write_text("schema: !!python/object/apply:os.system ['touch ran']\n")
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump(strip | hostile))
    main(["sweep", "sweep.yaml", "--list"])
    assert "Traceback" not in capsys.readouterr().err
    assert not (tmp_path / "ran").exists()
    sys.modules.pop("own", None)


def test_yaml_of_a_sweep_file_makes_no_python_objects(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.yaml").write_text("schema: !!python/object/apply:os.system ['touch ran']\nscene: bending\n")
    assert main(["sweep", "sweep.yaml", "--list"]) == 2
    assert "sweep.yaml:1:" in capsys.readouterr().err and not (tmp_path / "ran").exists()


@pytest.fixture
def elsewhere(tmp_path):
    """A folder of a sweep file, beside which there is code of another owner."""
    (tmp_path / "other.py").write_text(RUN_ME)
    folder = tmp_path / "sweep"
    (folder / "below").mkdir(parents=True)
    (folder / "below/own.py").write_text("def own(run):\n    return 1.0\n")
    (folder / "link.py").symlink_to(tmp_path / "other.py")
    (folder / "folder").symlink_to(tmp_path)
    (folder / "round.py").symlink_to("round.py")
    return folder


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("{folder}/below/own.py", "is outside the folder of the sweep file"),
        ("../other.py", "is outside the folder of the sweep file"),
        ("below/../below/own.py", "is outside the folder of the sweep file"),
        ("link.py", "is outside the folder of the sweep file"),
        ("folder/other.py", "is outside the folder of the sweep file"),
        ("round.py", "round.py"),
        ("os", "is no .py file; must be FILE.py:NAME"),
    ],
)
def test_code_outside_the_folder_of_the_sweep_file_is_refused_and_not_run(strip, elsewhere, place, told):
    strip["metrics"]["own"] = {"function": f"{place.format(folder=elsewhere)}:own"}
    (elsewhere / "sweep.yaml").write_text(yaml.safe_dump(strip))
    with pytest.raises(InputError, match="metrics.own: found") as error:
        read_sweep(elsewhere / "sweep.yaml")
    assert told in str(error.value)
    assert not list(elsewhere.parent.rglob("ran"))


def test_a_link_to_a_sweep_file_finds_the_code_beside_that_file(strip, elsewhere, tmp_path):
    strip["metrics"]["own"] = {"function": "below/own.py:own"}
    (elsewhere / "sweep.yaml").write_text(yaml.safe_dump(strip))
    (tmp_path / "linked.yaml").symlink_to(elsewhere / "sweep.yaml")
    assert read_sweep(tmp_path / "linked.yaml").job.codes["below/own.py:own"].name == "own"
