"""A ROS graph of its own for a test: a master on loopback, nodes, and what they say."""

import collections
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
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


class Network:
    """A network namespace whose one cable ends here, at addresses that no run that was killed has left taken."""

    def __init__(self):
        self.name = f"ds{os.getpid() % 100000}"
        subnet, last = random.SystemRandom().randrange(256), 4 * random.SystemRandom().randrange(64)
        self.here, self.there = (f"10.213.{subnet}.{last + end}" for end in (1, 2))
        commands = (f"netns add {self.name}", f"link add {self.name}a type veth peer name {self.name}b",
                    f"link set {self.name}b netns {self.name}", f"addr add {self.here}/30 dev {self.name}a",
                    f"link set {self.name}a up", f"-n {self.name} addr add {self.there}/30 dev {self.name}b",
                    f"-n {self.name} link set {self.name}b up", f"-n {self.name} link set lo up")
        self.problem = ""
        for command in commands:
            try:
                result = subprocess.run(["ip", *command.split()], capture_output=True, text=True)
            except FileNotFoundError:
                self.problem = "there is no ip (iproute2)"
                return
            if result.returncode != 0:
                self.problem = f"ip {command}: {result.stderr.strip()}"
                return

    def end(self):
        subprocess.run(["ip", "link", "del", f"{self.name}a"], capture_output=True)
        subprocess.run(["ip", "netns", "del", self.name], capture_output=True)


class Relay:
    """Passes the messages of a topic on after a delay, and loses a share of them."""

    def __init__(self, kind, source, target, delay_s, lost, seed=5):
        self.draw, self.lost, self.delay_s = random.Random(seed), lost, delay_s
        self.waiting, self.passed, self.dropped = collections.deque(), 0, 0
        self.publisher = rospy.Publisher(target, kind, queue_size=10)
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.pass_on, daemon=True)
        self.thread.start()
        self.subscriber = rospy.Subscriber(source, kind, self.take)

    def take(self, message):
        if self.draw.random() < self.lost:
            self.dropped += 1
        else:
            self.waiting.append((time.monotonic() + self.delay_s, message))

    def pass_on(self):
        while not self.ended.wait(0.002):
            while self.waiting and self.waiting[0][0] <= time.monotonic():
                self.publisher.publish(self.waiting.popleft()[1])
                self.passed += 1

    def end(self):
        self.subscriber.unregister()
        self.ended.set()
        self.thread.join()
        self.publisher.unregister()


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
        self.nodes, self.count = [], 0
        self.start("/usr/bin/rosmaster", "--core", "-p", str(port))
        wait_until(rosgraph.is_master_online, "the master is there")
        rospy.init_node("test", anonymous=True, disable_signals=True)

    def path(self, *names):
        return os.path.join(self.folder.name, *names)

    def start(self, program, *arguments, network=None):
        """A program of the package, or of a path; at the other end of the network, if there is one."""
        command, environment = [os.path.join(self.build, program), *arguments], dict(os.environ)
        if network is not None:
            command = ["ip", "netns", "exec", network.name, *command]
            environment["ROS_IP"] = network.there
        node = Node(command, environment, self.path(f"log{self.count}.txt"))
        self.nodes.append(node)
        self.count += 1
        return node

    def play(self, bag, *arguments):
        """Plays a bag once somebody listens to its images."""
        return self.start("/usr/bin/rosbag", "play", "--quiet", "--wait-for-subscribers", *arguments, bag)

    @staticmethod
    def wait_for_detector():
        """slam_node and a detector_node, or a relay between them, know of each other."""
        master = rosgraph.Master(rospy.get_name())

        def is_complete():
            publishers, subscribers, _ = (dict(part) for part in master.getSystemState())
            return ("/detector/detections" in publishers and "/detector/detections" in subscribers and
                    "/detector/image/compressed" in subscribers)
        wait_until(is_complete, "both nodes are there")

    def stop_nodes(self):
        """All but the master; what they were told by parameters is forgotten."""
        for node in self.nodes[1:]:
            node.stop()
        del self.nodes[1:]
        for name in ("/slam_node", "/detector_node"):
            if rospy.has_param(name):
                rospy.delete_param(name)

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


def pose_tuple(message):
    """(stamp, position, quaternion w x y z) of a PoseStamped, as horn.py has poses."""
    p, q = message.pose.position, message.pose.orientation
    return (message.header.stamp.to_sec(), (p.x, p.y, p.z), (q.w, q.x, q.y, q.z))
