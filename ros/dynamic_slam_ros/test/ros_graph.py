"""A ROS graph of its own for a test: a master on loopback, nodes, and what they say."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time

SKIPPED = 77

try:
    import rosgraph
    import rospy
except ImportError as missing:
    print(f"skipped: {missing}; scripts/packages_ros.txt has the packages")
    sys.exit(SKIPPED)


def wait_until(condition, what, seconds=60):
    """The first true value of the condition."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.05)
    raise AssertionError(f"after {seconds} s still not: {what}")


class Node:
    """A program in the graph; what it prints is in `log`."""

    def __init__(self, command, environment, log):
        self.log = log
        with open(log, "w", encoding="utf-8") as output:
            self.process = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=output,
                                            stderr=subprocess.STDOUT)

    def text(self):
        with open(self.log, encoding="utf-8", errors="replace") as file:
            return file.read()

    def is_alive(self):
        return self.process.poll() is None

    def wait(self, seconds=300):
        return self.process.wait(seconds)

    def stop(self, kill=False):
        """Its exit code."""
        if self.is_alive():
            self.process.send_signal(signal.SIGKILL if kill else signal.SIGINT)
        try:
            return self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise


class Graph:
    """One for each test program, as a process can be one node only. Its programs are in the folder `build`."""

    def __init__(self, build, address="127.0.0.1"):
        self.build = build
        self.folder = tempfile.TemporaryDirectory()
        with socket.socket() as free:
            free.bind((address, 0))
            port = free.getsockname()[1]
        os.environ.update({"ROS_MASTER_URI": f"http://{address}:{port}", "ROS_IP": address,
                           "ROS_HOME": self.folder.name, "ROS_LOG_DIR": self.folder.name,
                           "ROS_PACKAGE_PATH": os.path.dirname(build)})
        os.environ.pop("ROS_HOSTNAME", None)
        self.nodes = []
        self.start("/usr/bin/rosmaster", "--core", "-p", str(port))
        wait_until(rosgraph.is_master_online, "the master is there")
        rospy.init_node("test", anonymous=True, disable_signals=True)

    def path(self, *names):
        return os.path.join(self.folder.name, *names)

    def start(self, program, *arguments, environment=None):
        """A program of the package, or of a path."""
        command = [os.path.join(self.build, program), *arguments]
        node = Node(command, {**os.environ, **(environment or {})}, self.path(f"log{len(self.nodes)}.txt"))
        self.nodes.append(node)
        return node

    def play(self, bag, *arguments):
        """Plays a bag once somebody listens to its images."""
        return self.start("/usr/bin/rosbag", "play", "--quiet", "--wait-for-subscribers", *arguments, bag)

    def end(self):
        rospy.signal_shutdown("the test is over")
        for node in reversed(self.nodes):
            node.stop(kill=True)
        self.folder.cleanup()


class Listener:
    """The messages of a topic, in the order in which they came."""

    def __init__(self, topic, kind):
        self.messages = []
        self.subscriber = rospy.Subscriber(topic, kind, self.messages.append, queue_size=1000)

    def __len__(self):
        return len(self.messages)

    def stop(self):
        self.subscriber.unregister()
