"""The installation and the Debian package: an example built on the library, the program in a clean root.

Usage: package_test.py BUILD_FOLDER PROGRAM
"""

import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
BUILD = PROGRAM = ""

# Nothing of the user's, and nothing that names the source tree.
CLEAN = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", "LC_ALL": "C.UTF-8"}


def run(*command, **options):
    return subprocess.run(command, capture_output=True, text=True, **options)


def succeed(*command, **options):
    result = run(*command, **options)
    assert result.returncode == 0, f"{command}: {result.stdout}{result.stderr}"
    return result.stdout


class FolderTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)

    def assert_program_works(self, program, data):
        """It says its version, and finds its cameras and its networks in the folder `data`."""
        self.assertRegex(succeed(program, "--version", env=CLEAN), r"^dynamic_slam \d+\.\d+\.\d+$")
        models = succeed(program, "models", "builtin", env=CLEAN)
        self.assertRegex(models, "^builtin +ready")
        self.assertIn(os.path.join(data, "config/detectors"), models)
        self.assertIn("SHA-256 as expected", models)


class InstalledTest(FolderTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.prefix = os.path.join(cls.folder, "prefix")
        succeed("cmake", "--install", BUILD, "--prefix", cls.prefix)

    def test_the_program_finds_what_it_is_installed_with(self):
        self.assert_program_works(os.path.join(self.prefix, "bin/dynamic_slam"),
                                  os.path.join(self.prefix, "share/dynamic_slam"))

    def test_a_project_that_is_not_ours_is_built_and_runs(self):
        corridor = os.path.join(self.folder, "corridor")
        succeed(PROGRAM, "simulate", "corridor", "--frames", "60", "--out", corridor)
        example, build, out = (os.path.join(self.folder, name) for name in ("example", "example_build", "example_out"))
        shutil.copytree(os.path.join(SOURCE, "examples/cpp"), example)
        os.mkdir(out)
        succeed("cmake", "-S", example, "-B", build, f"-DCMAKE_PREFIX_PATH={self.prefix}")
        succeed("cmake", "--build", build)
        output = succeed(os.path.join(build, "follow_video"), corridor,
                         os.path.join(corridor, "camera.yaml"), out, env=CLEAN)
        self.assertRegex(output, r"\d+ poses and 1 parts of a map")
        with open(os.path.join(out, "trajectory.txt")) as file:
            self.assertGreater(sum(not line.startswith("#") for line in file), 40)
        self.assertIn("keyframes", succeed(PROGRAM, "map", "info", os.path.join(out, "map")))
        result = run(os.path.join(build, "follow_video"), os.path.join(self.folder, "nothing"), "tum_fr1", out, env=CLEAN)
        self.assertEqual(result.returncode, 1)
        self.assertIn("there is no such file or folder", result.stderr)

    def test_each_header_stands_by_itself(self):
        include = os.path.join(self.prefix, "include")
        headers = sorted(glob.glob(os.path.join(include, "**/*.h"), recursive=True))
        self.assertGreater(len(headers), 10)
        flags = succeed("pkg-config", "--cflags", "eigen3", "opencv4").replace("-I", "-isystem ").split()
        for header in headers:
            name = os.path.relpath(header, include)
            succeed("g++", "-std=c++20", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++", "-I", include,
                    *flags, "-", input=f'#include "{name}"\n')

    def test_the_library_shows_its_api_and_nothing_else(self):
        library = glob.glob(os.path.join(self.prefix, "lib/**/libdynamic_slam.so"), recursive=True)
        self.assertEqual(len(library), 1)
        names = [line.split(" ", 2)[2] for line in succeed("nm", "-DC", "--defined-only", library[0]).splitlines()]
        own = [name for name in names if "dynamic_slam::" in name]
        self.assertIn("dynamic_slam::System::Finish()", own)
        for hidden in ("SlamSystem::", "Tracker::", "LoopCloser::", "ReadImage("):
            self.assertEqual([name for name in own if name.startswith("dynamic_slam::" + hidden)], [])

    def test_the_manual_page_has_all_commands_and_options(self):
        with open(os.path.join(self.prefix, "share/man/man1/dynamic_slam.1")) as file:
            page = file.read().replace("\\-", "-")
        commands = [[]]
        while commands:
            command = commands.pop()
            text = succeed(PROGRAM, *command, "--help")
            for option in re.findall(r"^  (?:-\w,)?(--[a-z-]+)", text, re.MULTILINE):
                if option not in ("--help", "--version"):
                    self.assertIn(option, page, f"{command}")
            below = re.search(r"^Subcommands:\n((?:  .*\n)+)", text, re.MULTILINE)
            for name in re.findall(r"^  (\w+)", below.group(1) if below else "", re.MULTILINE):
                commands.append([*command, name])
                self.assertIn('.SS "' + " ".join([*command, name]) + '"', page)
        with open(os.path.join(SOURCE, "docs/config.md")) as file:
            keys = re.findall(r"^\| `([a-z_0-9.]+)`", file.read(), re.MULTILINE)
        self.assertGreater(len(keys), 50)
        for key in keys:
            self.assertIn(f"\\fB{key}\\fR", page)

    @unittest.skipUnless(shutil.which("groff"), "needs groff")
    def test_the_manual_page_is_formatted_without_complaint(self):
        result = run("groff", "-man", "-Tutf8", "-ww", os.path.join(self.prefix, "share/man/man1/dynamic_slam.1"))
        self.assertEqual((result.returncode, result.stderr), (0, ""))


class DebianPackageTest(FolderTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        if not shutil.which("dpkg-shlibdeps"):
            raise unittest.SkipTest("needs dpkg-dev")
        succeed("cpack", "-G", "DEB", "-B", cls.folder, "--config", os.path.join(BUILD, "CPackConfig.cmake"))
        (cls.package,) = glob.glob(os.path.join(cls.folder, "*.deb"))

    def test_says_what_it_is_and_needs(self):
        fields = succeed("dpkg-deb", "--field", self.package)
        self.assertIn("Package: dynamic-slam", fields)
        self.assertRegex(fields, r"Depends: .*libopencv-dnn")

    def test_is_installed_in_a_clean_root_works_and_goes_again(self):
        root = os.path.join(self.folder, "root")
        admin = os.path.join(root, "var/lib/dpkg")
        for name in ("info", "updates", "triggers"):
            os.makedirs(os.path.join(admin, name))
        open(os.path.join(admin, "status"), "w").close()
        # Depends are those of the machine, and need not be in the root too.
        dpkg = ["dpkg", f"--root={root}", "--force-depends", "--force-not-root", "--force-script-chrootless",
                f"--log={self.folder}/dpkg.log"]
        if os.geteuid() != 0:
            dpkg.insert(0, "fakeroot")
        succeed(*dpkg, "--install", self.package)
        self.assert_program_works(os.path.join(root, "usr/bin/dynamic_slam"), os.path.join(root, "usr/share/dynamic_slam"))
        self.assertTrue(os.path.exists(os.path.join(root, "usr/share/man/man1/dynamic_slam.1")))
        succeed(*dpkg, "--purge", "dynamic-slam")
        left = [os.path.join(path, name) for path, _, names in os.walk(root) for name in names
                if not path.startswith(admin)]
        self.assertEqual(left, [])


if __name__ == "__main__":
    BUILD, PROGRAM = sys.argv.pop(1), sys.argv.pop(1)
    unittest.main()
