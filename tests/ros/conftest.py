"""Real nodes in processes of their own, and a client node in the test's process; every test has its own ROS domain."""

import itertools
import math
import os
import time
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from rcl_interfaces.srv import GetParameters, GetParameterTypes, SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from support import forked, synthetic_run
from support.processes import claimed_domain

from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_sim_ros.simulation_node import SimulationNode

NODE = "/bilayer_sim"
# Longest wait for anything that needs discovery or a first compilation [s].
LIMIT = 120.0

_numbers = itertools.count()


class NodeProcess:
    """An executable of the package, running or ended, with everything that it printed."""

    def __init__(self, module, directory, domain, parameters=None, arguments=(), program=""):
        self.domain = domain
        arguments = [*map(str, arguments)]
        if parameters:
            arguments += ["--ros-args"]
            for name, value in parameters.items():
                arguments += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        self._output = directory / f"{module}-{next(_numbers)}.txt"
        self._output.touch()
        program += f"import sys\nfrom bilayer_sim_ros.{module} import main\nsys.exit(main())\n"
        self._process = forked.start(program, arguments, domain, directory, self._output)

    @property
    def output(self) -> str:
        return self._output.read_text()

    @property
    def running(self) -> bool:
        return self._process.exitcode is None

    @property
    def pid(self) -> int:
        return self._process.pid

    def send(self, number):
        with suppress(ProcessLookupError):  # it has ended
            os.kill(self.pid, number)

    def wait_for(self, text):
        """Return once the output has `text`."""
        deadline = time.monotonic() + LIMIT
        while text not in self.output:
            assert self.running and time.monotonic() < deadline, f"no {text!r} in:\n{self.output}"
            time.sleep(0.05)

    def wait(self, limit=LIMIT) -> int:
        """Exit code."""
        self._process.join(limit)
        assert not self.running, f"the node does not end:\n{self.output}"
        return self._process.exitcode

    def end(self):
        self._process.terminate()
        self._process.join(20)
        self._process.kill()
        self._process.join()


class Client:
    """A node of the test's own that listens to a process, sends to it and calls its services."""

    def __init__(self, process):
        self._process, self.domain = process, process.domain
        self._context = Context()
        rclpy.init(context=self._context, domain_id=process.domain)
        self.node = Node("client", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._callers = {}

    def spin_until(self, condition, what, limit=LIMIT):
        """Serve callbacks until `condition()` is true; its value."""
        deadline = time.monotonic() + limit
        while not (value := condition()):
            assert time.monotonic() < deadline, f"waited {limit} s for {what}"
            if self._process.running:
                self._executor.spin_once(timeout_sec=0.05)
            else:  # its last message may arrive after its end
                self.drain()
                assert condition(), f"the node ended while the test waited for {what}:\n{self._process.output}"
        return value

    def drain(self, quiet=0.1):
        """Receive what is on its way, until nothing has come for `quiet` seconds; of a paused node that is soon."""
        with suppress(TimeoutException):
            while True:
                serve, _, _ = self._executor.wait_for_ready_callbacks(timeout_sec=quiet)
                serve()
                serve.result()

    def listen(self, message_type, topic) -> list:
        """A list that grows with every message; it has one already."""
        messages = []
        self.node.create_subscription(message_type, topic, messages.append, 1000)
        self.spin_until(lambda: messages, f"a message on {topic}")
        return messages

    def sender(self, message_type, topic):
        """A function that publishes on `topic`, once somebody subscribes to it."""
        publisher = self.node.create_publisher(message_type, topic, 10)
        self.spin_until(lambda: publisher.get_subscription_count() > 0, f"a subscriber of {topic}")
        return publisher.publish

    def spin_to_the_end(self):
        """Serve callbacks until the process has ended, and then what is on its way."""
        deadline = time.monotonic() + 2 * LIMIT  # topics are there before kernels are compiled
        while self._process.running:
            assert time.monotonic() < deadline, f"the node does not end:\n{self._process.output}"
            self._executor.spin_once(timeout_sec=0.05)
        self.drain()

    def caller(self, name, node=NODE, kind=Trigger):
        """A client of the node's service `name`, which knows where answers go: those to a reader not yet discovered are
        lost.
        """
        service = f"{node}/{name}"
        if service in self._callers:
            return self._callers[service]
        client = self._callers[service] = self.node.create_client(kind, service)
        # A node learns readers in the order of their creation: it knows this one when it answers a later one.
        probe = self.node.create_client(GetParameterTypes, f"{node}/get_parameter_types")
        self.spin_until(lambda: client.service_is_ready() and probe.service_is_ready(), f"the service {service}")
        answers, asked = [], -math.inf

        def answered():
            nonlocal asked
            if time.monotonic() > asked + 1.0:
                asked = time.monotonic()
                answers.append(probe.call_async(GetParameterTypes.Request()))
            return any(answer.done() for answer in answers)

        self.spin_until(answered, f"the discovery of the client of {service}")
        self.node.destroy_client(probe)
        return client

    def request(self, name, node=NODE, kind=Trigger, request=None):
        """Call the node's service `name`; the future of its answer."""
        return self.caller(name, node, kind).call_async(request or kind.Request())

    def call(self, name, node=NODE, kind=Trigger, request=None):
        """Call the node's service `name`; its answer."""
        future = self.request(name, node, kind, request)
        self.spin_until(future.done, f"an answer of {name}")
        return future.result()

    def set_parameter(self, name, value, node=NODE):
        """Set a parameter of the node; the result."""
        wished = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call("set_parameters", node, SetParameters, wished).results[0]

    def get_parameter(self, name, node=NODE):
        """The value of a parameter that is a number."""
        asked = GetParameters.Request(names=[name])
        return self.call("get_parameters", node, GetParameters, asked).values[0].double_value

    def end(self):
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture(scope="module")
def residents():
    """Processes and clients in a domain, which end before another test may have it."""
    return []


@pytest.fixture(scope="module")
def start(tmp_path_factory, residents):
    """Starts executables of the package in a domain, after a program that changes them; they end with the fixture that
    gave the domain.
    """

    def begin(module, domain, parameters=None, arguments=(), program=""):
        directory = tmp_path_factory.mktemp("node")
        residents.append(NodeProcess(module, directory, domain, parameters, arguments, program))
        return residents[-1]

    return begin


@pytest.fixture(scope="module")
def connect(residents):
    """Makes clients of processes; they close with the fixture that gave the domain."""

    def begin(process):
        residents.append(Client(process))
        return residents[-1]

    return begin


def inhabited(residents):
    """A claimed domain, in which everybody ends before it is given back."""
    with claimed_domain() as domain:
        yield domain
        for resident in [of for of in residents if of.domain == domain]:
            residents.remove(resident)
            resident.end()


@pytest.fixture
def domain(residents):
    yield from inhabited(residents)


@pytest.fixture(scope="module")
def domain_of_module(residents):
    yield from inhabited(residents)


@pytest.fixture(scope="module")
def run_log(tmp_path_factory):
    """Half a second of a run, all topics."""
    path = tmp_path_factory.mktemp("logs") / "run.mcap"
    synthetic_run.run(McapRecorder(path, 50.0, 20.0), np.linspace(0.0, 0.5, 26))
    return path


@pytest.fixture
def contexts(domain):
    """Two contexts: one alone refuses two types of a topic, and a client in the other is another participant."""
    made = Context(), Context()
    for context in made:
        rclpy.init(context=context, domain_id=domain)
    yield made
    for context in made:
        context.try_shutdown()


@pytest.fixture
def noting_node(contexts, monkeypatch):
    """Makes a node of a scene that is not started, and notes its warnings as `lines`."""
    nodes = []

    def make(scene="bending", cli_args=None, **values):
        overrides = [Parameter(name, value=value) for name, value in {"scene": scene, **values}.items()]
        node = SimulationNode(context=contexts[0], cli_args=cli_args, parameter_overrides=overrides)
        node.lines = []
        logger = SimpleNamespace(warning=lambda text, **_: node.lines.append(text))
        monkeypatch.setattr(node, "get_logger", lambda: logger)
        nodes.append(node)
        return node

    yield make
    for node in nodes:
        node.destroy_node()
