"""`dynamic_slam config` as a user meets it, and docs/config.md, which it writes."""

import os
import subprocess
import sys
import tempfile
import unittest

PROGRAM = ""
PAGE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "docs", "config.md")


def config(*arguments):
    return subprocess.run([PROGRAM, "config", *arguments], capture_output=True, text=True)


class CliConfigTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = os.path.join(folder.name, "a.yaml")

    def write(self, text):
        with open(self.file, "w") as file:
            file.write(text)

    def assert_output(self, result, *parts):
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        for part in parts:
            self.assertIn(part, result.stdout)

    def assert_input_error(self, result, *parts):
        self.assertEqual((result.returncode, result.stdout), (2, ""))
        for part in parts:
            self.assertIn(part, result.stderr)

    def test_the_page_in_docs_is_up_to_date(self):
        result = config("--markdown")
        self.assert_output(result)
        with open(PAGE) as page:
            self.assertTrue(page.read() == result.stdout,
                            f"docs/config.md is out of date; this renews it:\n"
                            f"  {os.path.relpath(PROGRAM, os.path.join(os.path.dirname(PAGE), '..'))} "
                            f"config --markdown > docs/config.md")

    def test_defaults_are_a_file_without_problems_and_differences(self):
        result = config("--defaults")
        self.assert_output(result, "orb:\n  # Keypoints wanted", "\n  features: 1000\n")
        self.write(result.stdout)
        checked = config("--check", self.file)
        self.assert_output(checked)
        self.assertRegex(checked.stdout, r"a\.yaml: \d+ options set, 0 of them differ from the defaults\n$")

    def test_check_lists_what_differs(self):
        self.write("orb:\n  features: 2000\n  levels: 8\n")
        self.assert_output(config("--check", self.file),
                           f"{self.file}: 2 options set, 1 of them differs from the defaults\n"
                           "  orb.features: 2000 (default 1000)\n")

    def test_check_reports_all_problems_with_lines(self):
        self.write("orb:\n  features: 2\n  levls: 3\nseed: many\n")
        self.assert_input_error(config("--check", self.file), "3 problems",
                                f"{self.file}:2: orb.features is 2, outside its range 50 to 20000",
                                f"{self.file}:3: unknown key 'orb.levls'. Did you mean 'orb.levels'?",
                                f"{self.file}:4: seed must be a whole number")
        self.assert_input_error(config("--check", self.file + ".no"), "a.yaml.no: cannot be read")

    def test_explains_a_key_and_a_section(self):
        self.assert_output(config("--explain", "tracker.motion_radius_px"), "tracker.motion_radius_px\n  Search radius",
                           "1 to 200 px, default 15.0 px")
        result = config("--explain", "tracker")
        self.assert_output(result, "tracker.min_inliers\n", "tracker.keyframe.max_frames\n")
        self.assertNotIn("mapper.", result.stdout)
        self.assert_input_error(config("--explain", "traker.keyframe"), "traker.keyframe",
                                "Did you mean 'tracker.keyframe'?")

    def test_does_one_thing_at_a_time(self):
        for arguments in ((), ("--defaults", "--markdown"), ("--explain", "orb", "--check", self.file)):
            self.assert_input_error(config(*arguments), "--defaults", "--explain", "--check")


if __name__ == "__main__":
    PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main()
