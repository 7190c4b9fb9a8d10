import ctypes
import os
import signal
import subprocess
import time

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String
from pythonfmu.enums import Fmi2Status

PARAMETER = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}


class Faulty(Fmi2Slave):
    """Does what `fault` says at the first step that starts at or after `at`, if its seed is `only`."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.fault, self.at, self.u, self.y = "", 0.5, 0.0, 0.0
        self.register_variable(String("fault", **PARAMETER))
        self.register_variable(Real("at", **PARAMETER))
        self.seed = self.only = 0
        self.register_variable(Integer("seed", **PARAMETER))
        self.register_variable(Integer("only", **PARAMETER))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def enter_initialization_mode(self):
        if self.fault == "chdir_at_start":
            os.chdir("/")

    def terminate(self):
        if self.fault == "chdir_at_end":
            os.chdir("/")

    def exit_initialization_mode(self):
        if self.fault == "initialization":
            raise ValueError("cannot start")
        if self.fault == "stuck":
            time.sleep(1e3)

    def do_step(self, t, h):
        self.y = t + h
        return self.fail() if t >= self.at - 1e-12 and self.seed == self.only else True

    def fail(self):
        if self.fault == "raise":
            raise ValueError("coil burnt")
        if self.fault == "discard":
            self.log("step too long", Fmi2Status.discard)
            return False
        if self.fault == "nan":
            self.y = float("nan")
        if self.fault == "infinite":
            self.y = float("inf")
        if self.fault == "warn":
            self.log("getting 100 %% warm", Fmi2Status.warning)
        if self.fault == "interrupt":
            os.kill(os.getpid(), signal.SIGINT)
        if self.fault == "insist":
            for _ in range(2):
                os.kill(os.getpid(), signal.SIGINT)
        if self.fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.fault == "slow":
            time.sleep(0.02)
        if self.fault == "print":
            print("coil says so", flush=True)
        if self.fault == "hang":
            time.sleep(1e3)
        if self.fault in ("fork", "fork_away"):  # the child, in a session of its own or not, keeps all pipes
            if os.fork() == 0:
                if self.fault == "fork_away":
                    os.setsid()
                time.sleep(1e3)
            os._exit(3)
        if self.fault == "fork_and_hang" and os.fork():
            time.sleep(1e3)
        if self.fault in ("fork_and_hang", "child_exits") and (self.fault != "child_exits" or os.fork() == 0):
            if self.fault == "child_exits":
                os._exit(0)
            time.sleep(1e3)
        if self.fault == "child_goes_on":
            os.fork()
        if self.fault == "close":
            os.closerange(3, 1024)
            time.sleep(1e3)
        if self.fault in ("leave", "leave_away"):
            subprocess.Popen(["sleep", "301"], start_new_session=self.fault == "leave_away")
        if self.fault == "chdir":
            os.chdir("/")
        if self.fault == "exit":
            os._exit(0)
        if self.fault == "segfault":
            ctypes.string_at(0)
        return True
