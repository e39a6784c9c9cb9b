#!/usr/bin/env python3
"""The installed units under a real systemd, in user-mode Linux: tests/system/service/run starts this.

No retries: every wait is for a condition with a generous limit, and a limit that is reached is a
failure. Times are the guest's; those that the units promise are checked, the others are printed.
"""
import ctypes
import json
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

INTERFACE = "vcan0"
UNIT = f"beltgripd@{INTERFACE}.service"
LIMIT_S = 40.0


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(f"{command}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def properties(unit=UNIT):
    return dict(line.split("=", 1) for line in run("systemctl", "show", unit).splitlines())


def wait(condition, what, limit_s=LIMIT_S):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {limit_s} s: {what}\n" + journal_text())


def active(unit=UNIT):
    found = properties(unit)
    return found if (found["ActiveState"], found["SubState"]) == ("active", "running") else None


def journal(*filters):
    text = run("journalctl", "-o", "json", "--no-pager", *filters)
    return [json.loads(line) for line in text.splitlines()]


def journal_text():
    return run("journalctl", "--no-pager", "-n", "60", "-o", "short-monotonic")


def bus(interface=INTERFACE):
    listener = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    listener.settimeout(LIMIT_S)
    listener.bind((interface,))
    return listener


def frame(listener, identifier=0x6A3):
    while True:
        found, length, data = struct.unpack("<IB3x8s", listener.recv(16))
        if found == identifier:
            return data[:length]


class Service(unittest.TestCase):
    """In this order: each leaves the service running."""

    @classmethod
    def setUpClass(cls):
        etc = pathlib.Path("/etc/beltgrip")
        etc.mkdir(exist_ok=True)
        (etc / "vcan0.env").write_text(
            "CAN_BITRATE=\nCAN_SAMPLE_POINT=\nCAN_RESTART_MS=\nCAN_QUEUE_LENGTH=\n")
        (etc / "rig.dbc").write_text(
            pathlib.Path("/run/src/tools/scenarios/paper-rig.dbc").read_text(encoding="latin-1"))
        (etc / "vcan0.toml").write_text("""
[bus]
interface = "vcan0"
dbc = ["rig.dbc"]
[signals]
primary_speed = "RIG_Speed.PrimarySpeed"
secondary_speed = "RIG_Speed.SecondarySpeed"
secondary_pressure = "RIG_Pressure.SecondaryPressure"
primary_torque = "RIG_Torque.PrimaryTorque"
[experiment]
trigger = "always"
""")
        run("systemctl", "enable", "-q", UNIT, f"beltgrip-can@{INTERFACE}.service")

    def test_1_starts_with_the_interface_once_it_is_up(self):
        self.assertNotEqual(properties()["ActiveState"], "active")
        run("ip", "link", "add", INTERFACE, "type", "vcan")  # down: the unit brings it up
        found = wait(active, "the service is running")
        up = properties(f"beltgrip-can@{INTERFACE}.service")
        self.assertEqual(up["ActiveState"], "active")
        self.assertLess(int(up["ExecMainExitTimestampMonotonic"]),
                        int(found["ExecMainStartTimestampMonotonic"]))
        self.assertIn("no result yet", found["StatusText"])
        self.assertEqual(found["NRestarts"], "0")
        lines = journal("-u", UNIT, "BELTGRIP_INTERFACE=vcan0", "SYSLOG_IDENTIFIER=beltgripd")
        self.assertTrue(any("version" in line["MESSAGE"] for line in lines), journal_text())
        self.assertFalse(any("BusDown" in line["MESSAGE"] for line in lines), journal_text())
        # Levels arrive as levels: no input has come, which is a warning.
        wait(lambda: any("InputMissing" in line["MESSAGE"] and line["PRIORITY"] == "4"
                         for line in journal("-u", UNIT)), "the warning in the journal")

    def test_2_sandbox_is_in_force(self):
        found = properties()
        pid = int(found["MainPID"])
        status = dict(line.split(":\t", 1) for line in
                      pathlib.Path(f"/proc/{pid}/status").read_text().splitlines() if ":\t" in line)
        for name in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"):
            self.assertEqual(int(status[name], 16), 0, name)
        self.assertNotEqual(status["Uid"].split()[0], "0")
        self.assertEqual(status["NoNewPrivs"], "1")
        self.assertEqual(status["Seccomp"], "2")
        self.assertGreater(int(status["VmLck"].split()[0]), 1000, "memory is locked")
        self.assertEqual(os.sched_getscheduler(pid) & ~0x40000000, os.SCHED_FIFO)
        self.assertEqual(os.sched_getparam(pid).sched_priority, 60)
        helpers = [int(t) for t in os.listdir(f"/proc/{pid}/task") if int(t) != pid]
        self.assertTrue(helpers)
        for thread in helpers:
            self.assertEqual(os.sched_getscheduler(thread) & ~0x40000000, os.SCHED_OTHER)
        self.assertTrue(os.path.isdir("/var/lib/private/beltgrip/vcan0"))
        self.assertTrue(os.path.isdir("/run/beltgrip/vcan0") or
                        os.path.isdir("/run/private/beltgrip/vcan0"))
        # What the filter leaves: the same properties, tried from inside.
        inside = []
        for name in ("RestrictAddressFamilies", "SystemCallFilter", "SystemCallErrorNumber",
                     "MemoryDenyWriteExecute", "ProtectSystem", "PrivateDevices", "ProtectHome"):
            inside += ["-p", f"{name}={found[name]}"] if found[name] else []
        probe = ("import socket\n"
                 "socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)\n"
                 "try: socket.socket(socket.AF_INET)\n"
                 "except OSError as error: print('inet', error.errno)\n"
                 "try: open('/usr/probe', 'w')\n"
                 "except OSError as error: print('usr', error.errno)\n")
        said = run("systemd-run", "-q", "--wait", "--pipe", "-p", "DynamicUser=yes", *inside,
                   "python3", "-c", probe)
        self.assertIn("inet 97", said)  # EAFNOSUPPORT
        self.assertIn("usr 30", said)  # EROFS

    def test_2b_anybody_may_ask_for_the_status(self):
        said = run("runuser", "-u", "nobody", "--", "beltgrip", "status", "--json")
        status = json.loads(said)
        self.assertEqual(status["interface"], INTERFACE)
        self.assertIn("InputMissing", status["faults"])
        self.assertEqual(status["signals"]["primary_speed"]["quality"], "missing")
        self.assertGreater(status["counters"]["samples"], 0)
        self.assertGreater(status["latency"]["sample_to_frame"]["count"], 0)
        self.assertIn("primary_speed", run("beltgrip", "status", INTERFACE))
        can = json.loads(run("beltgrip", "can", "status", INTERFACE, "--json"))
        self.assertEqual((can["up"], can["driver"], can["controller"], can["state"]),
                         (True, "vcan", False, None))

    def test_2c_the_daemons_own_tests_pass_inside_the_filter(self):
        # The unit's system calls, address families and memory rules around all of daemon_test; as
        # root, for it makes interfaces and namespaces, which its daemon does not.
        found = properties()
        inside = ["-p", "LimitMEMLOCK=64M"]
        for name in ("SystemCallFilter", "SystemCallErrorNumber", "SystemCallArchitectures",
                     "RestrictAddressFamilies", "MemoryDenyWriteExecute", "LockPersonality",
                     "RestrictRealtime", "RestrictSUIDSGID"):
            self.assertTrue(found[name], name)
            inside += ["-p", f"{name}={found[name]}"]
        # Where it was built, its programs are looked for under that path.
        build = pathlib.Path(os.environ["SERVICE_BUILD"])
        source = pathlib.Path(pathlib.Path("/run/vcan/cwd").read_text().strip())
        source.mkdir(parents=True, exist_ok=True)
        run("mount", "--bind", "/run/src", str(source))
        begin = time.monotonic()
        said = run("systemd-run", "-q", "--wait", "--pipe", *inside, "sh", "-c",
                   f"grep '^Seccomp:' /proc/self/status; exec {build}/tests/daemon_test "
                   "--gtest_brief=1")
        self.assertRegex(said, r"Seccomp:\s+2\n")
        passed = re.search(r"PASSED.* (\d+) tests", said)
        self.assertTrue(passed and int(passed[1]) > 20, said)
        print(f"inside the filter: {passed[1]} tests in {time.monotonic() - begin:.0f} s")

    def test_3_a_hung_loop_is_killed_and_comes_back(self):
        before = properties()
        pid = int(before["MainPID"])
        libc = ctypes.CDLL(None, use_errno=True)
        libc.ptrace.argtypes = [ctypes.c_ulong] * 4
        seize, interrupt = 0x4206, 0x4207
        # The loop's thread alone: the helper lives on and must not feed the watchdog.
        self.assertEqual(libc.ptrace(seize, pid, 0, 0), 0, os.strerror(ctypes.get_errno()))
        self.assertEqual(libc.ptrace(interrupt, pid, 0, 0), 0)
        begin = time.monotonic()
        # As its tracer this process has to let it die.
        def reaped():
            try:
                done, how = os.waitpid(pid, os.WNOHANG | 0x40000000)
            except ChildProcessError:
                return True
            if done and os.WIFSTOPPED(how) and how >> 16 == 0:
                libc.ptrace(7, pid, 0, os.WSTOPSIG(how))  # PTRACE_CONT: the signal reaches it
            return done and (os.WIFSIGNALED(how) or os.WIFEXITED(how))
        wait(reaped, "the end of the hung process")
        killed = time.monotonic() - begin
        after = wait(lambda: (f := active()) and f["MainPID"] != str(pid) and f,
                     "the service is back")
        print(f"watchdog: killed after {killed:.2f} s, back after {time.monotonic() - begin:.2f} s")
        self.assertEqual(int(after["NRestarts"]), int(before["NRestarts"]) + 1)
        self.assertTrue(any("watchdog" in line["MESSAGE"].lower() for line in journal("-u", UNIT)))
        self.assertLess(killed, 4.0)

    def test_4_a_crash_is_survived(self):
        before = properties()
        os.kill(int(before["MainPID"]), signal.SIGKILL)
        after = wait(lambda: (f := active()) and f["MainPID"] != before["MainPID"] and f,
                     "the service is back")
        self.assertEqual(int(after["NRestarts"]), int(before["NRestarts"]) + 1)

    def test_5_link_down_and_up_is_the_daemons_own_business(self):
        pid = properties()["MainPID"]
        run("ip", "link", "set", INTERFACE, "down")
        wait(lambda: "BusDown" in properties()["StatusText"], "BusDown in the status")
        run("ip", "link", "set", INTERFACE, "up")
        wait(lambda: "BusDown" not in properties()["StatusText"], "BusDown is gone")
        self.assertEqual(properties()["MainPID"], pid)
        self.assertEqual(properties()["ActiveState"], "active")

    def test_6_interface_unplugged_and_back(self):
        pid = properties()["MainPID"]
        setup = f"beltgrip-can@{INTERFACE}.service"
        for notice in (True, False):  # slowly, and quicker than anybody sees it gone
            run("ip", "link", "delete", INTERFACE)
            if notice:
                wait(lambda: "BusDown" in properties()["StatusText"], "BusDown in the status")
                wait(lambda: properties(setup)["ActiveState"] == "inactive", "set-up is to be done")
            run("ip", "link", "add", INTERFACE, "type", "vcan")
            wait(lambda: "UP" in run("ip", "-br", "link", "show", INTERFACE), "the link is up")
            with bus() as listener:
                frame(listener)
            wait(lambda: "BusDown" not in properties()["StatusText"], "BusDown is gone")
        found = properties()
        self.assertEqual((found["MainPID"], found["ActiveState"]), (pid, "active"))

    def test_7_stops_within_200_ms(self):
        with bus() as listener:
            frame(listener)
        run("systemctl", "stop", UNIT)
        found = properties()
        took_ms = (int(found["InactiveEnterTimestampMonotonic"]) -
                   int(found["ActiveExitTimestampMonotonic"])) / 1000
        print(f"stop: {took_ms:.0f} ms from the request to the end")
        self.assertEqual(found["Result"], "success")
        self.assertEqual(found["ExecMainStatus"], "0")
        self.assertLess(took_ms, 200)
        run("systemctl", "start", UNIT)

    def test_7b_reload_takes_a_right_configuration_and_keeps_the_old_one_otherwise(self):
        config = pathlib.Path("/etc/beltgrip/vcan0.toml")
        good = config.read_text()
        pid = wait(active, "the service is running")["MainPID"]
        config.write_text(good.replace("[signals]", "identifiers = { status = 0x6B3 }\n[signals]"))
        run("systemctl", "reload", UNIT)
        with bus() as listener:
            frame(listener, 0x6B3)
        config.write_text(good + "\nno_such_key = 1\n")
        run("systemctl", "reload", UNIT)
        said = wait(lambda: [line for line in journal("-u", UNIT)
                             if "reload refused" in line["MESSAGE"]], "the refusal in the journal")
        self.assertEqual((len(said), said[0]["PRIORITY"]), (1, "4"))
        self.assertIn("no_such_key", said[0]["MESSAGE"])
        with bus() as listener:
            frame(listener, 0x6B3)
        config.write_text(good)
        run("systemctl", "reload", UNIT)
        with bus() as listener:
            frame(listener)
        found = wait(active, "reloading is over")
        self.assertEqual((found["MainPID"], found["Result"]), (pid, "success"))
        self.assertGreater(
            int(dict(line.split(":\t", 1) for line in pathlib.Path(f"/proc/{pid}/status")
                     .read_text().splitlines() if ":\t" in line)["VmLck"].split()[0]), 1000)

    def test_7c_the_flight_recorder_of_the_example_keeps_what_replay_reads(self):
        example = next(pathlib.Path("/usr/share/doc").glob("*/examples/beltgripd-record.conf"))
        drop_in = pathlib.Path("/etc/systemd/system/beltgripd@.service.d")
        drop_in.mkdir()
        (drop_in / example.name).write_text(example.read_text())
        run("systemctl", "daemon-reload")
        run("systemctl", "restart", UNIT)
        wait(lambda: "InputMissing" in active()["StatusText"], "a fault, which is kept")
        run("systemctl", "stop", UNIT)
        self.assertEqual(properties()["Result"], "success")
        records = list(pathlib.Path("/var/lib/private/beltgrip/vcan0/record").iterdir())
        self.assertTrue(records)
        self.assertNotEqual(records[0].stat().st_uid, 0)  # the dynamic user's
        said = json.loads(run("beltgrip", "replay", str(records[0]), "--config",
                              "/etc/beltgrip/vcan0.toml", "--json", "-").splitlines()[-1])
        self.assertEqual((said["type"], said["lines_bad"]), ("summary", 0))
        (drop_in / example.name).unlink()
        drop_in.rmdir()
        run("systemctl", "daemon-reload")
        run("systemctl", "start", UNIT)

    def test_8_a_wrong_configuration_is_not_tried_again(self):
        config = pathlib.Path("/etc/beltgrip/vcan0.toml")
        good = config.read_text()
        config.write_text(good + "\nno_such_key = 1\n")
        run("systemctl", "reset-failed", UNIT)
        subprocess.run(["systemctl", "restart", UNIT], capture_output=True)
        found = properties()
        self.assertEqual((found["ActiveState"], found["ExecMainStatus"], found["NRestarts"]),
                         ("failed", "78", "0"))
        self.assertTrue(any("no_such_key" in line["MESSAGE"] for line in journal("-u", UNIT)))
        config.write_text(good)
        run("systemctl", "restart", UNIT)
        wait(active, "the service is back")

    def test_9_a_crash_loop_ends(self):
        run("systemctl", "reset-failed", UNIT)
        pid = None
        for _ in range(12):
            found = wait(lambda: (f := properties()) and
                         (f["ActiveState"] == "failed" or f["MainPID"] not in ("0", pid)) and f,
                         "the next start, or the limit")
            if found["ActiveState"] == "failed":
                break
            pid = found["MainPID"]
            os.kill(int(pid), signal.SIGKILL)
        wait(lambda: properties()["ActiveState"] == "failed", "the start limit")
        self.assertTrue(any("repeated too quickly" in line["MESSAGE"]
                            for line in journal("-u", UNIT)), journal_text())


if __name__ == "__main__":
    print(f"systemd is up {time.clock_gettime(time.CLOCK_BOOTTIME):.1f} s after the boot")
    unittest.main(verbosity=2, argv=sys.argv[:1], failfast=False)
