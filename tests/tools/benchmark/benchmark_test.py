#!/usr/bin/python3
"""benchmark_test.py SOURCE BELTGRIP GENERATE: the benchmark's recipe, answers and scorer, made small."""
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE, PROGRAM, GENERATE = (Path(each).resolve() for each in sys.argv[1:4])
FOLDER = SOURCE / "tools/benchmark"
os.environ.update(BELTGRIP=str(PROGRAM), GENERATE=str(GENERATE))
sys.path.insert(0, str(FOLDER))
import document  # noqa: E402
import score  # noqa: E402

HEADER = "id,stop_s,mu_max,lo,hi,kind\n"
# Slip runs from 0 to 10 % in 10 s, the peak is at 4 %.
TRUTH = {"plant": "rig", "noise": "lab", "family": "tanh_fall", "kind": "clean", "peak_s": 4.0,
         "near_s": 3.2, "mu_max": 0.1, "course": [[0.0, 0.0], [10.0, 10.0]]}
RISING = {"plant": "rig", "noise": "lab", "family": "rising", "kind": "clean", "peak_s": None,
          "mu_max": 0.12}


def run(script, *arguments):
    return subprocess.run([FOLDER / script, *map(str, arguments)], capture_output=True, text=True)


class Recipe(unittest.TestCase):
    def test_same_seed_same_bytes_and_other_seed_other_bytes(self):
        with tempfile.TemporaryDirectory() as name:
            manifests = []
            for folder, seed in (("a", 5), ("b", 5), ("c", 6)):
                done = run("make.py", Path(name) / folder, "--count", 2, "--seed", seed)
                self.assertEqual(done.returncode, 0, done.stderr)
                manifests.append((Path(name) / folder / "manifest.json").read_text())
            self.assertEqual(manifests[0], manifests[1])
            first, other = (json.loads(each) for each in manifests[1:])
            for each in first["experiments"]:
                self.assertNotEqual(first["experiments"][each]["files"]["trace.log"],
                                    other["experiments"][each]["files"]["trace.log"])
            self.assertEqual({e["plant"] for e in first["experiments"].values()}, {"rig", "car"})
            for method in ("robust", "largest"):
                answers = run("answer.py", Path(name) / "a", method)
                self.assertEqual(answers.returncode, 0, answers.stderr)
                path = Path(name) / f"{method}.csv"
                path.write_text(answers.stdout)
                scored = run("score.py", Path(name) / "a", path, "--by", "plant")
                self.assertEqual(scored.returncode, 0, scored.stderr)
                self.assertIn(f"| {method}, car |", scored.stdout)
                if method == "largest":
                    self.assertIn("| largest | 0 % of 2 |", scored.stdout)

    def test_campaigns(self):
        with tempfile.TemporaryDirectory() as name:
            manifests = []
            for folder in ("a", "b"):
                done = run("make_campaigns.py", Path(name) / folder, "--count", 2)
                self.assertEqual(done.returncode, 0, done.stderr)
                manifests.append((Path(name) / folder / "manifest.json").read_text())
            self.assertEqual(manifests[0], manifests[1])
            path = Path(name) / "nothing.csv"
            path.write_text(run("answer_campaigns.py", Path(name) / "a", "nothing").stdout)
            scored = run("score.py", Path(name) / "a", path)
            # One of the two has a cause, which this answer never names.
            self.assertIn("| nothing | 50 % of 2 | 0 % of 1 | none | 0 % of 1 |", scored.stdout)


    def test_a_program_that_is_not_there(self):
        with tempfile.TemporaryDirectory() as name:
            os.environ["BELTGRIP"] = f"{name}/none"
            try:
                done = run("make.py", Path(name) / "a", "--count", 1)
            finally:
                os.environ["BELTGRIP"] = str(PROGRAM)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (66, 1), done.stderr)


class Scorer(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = Path(place.name)
        self.seal({"000": TRUTH, "001": RISING})

    def seal(self, truths):
        text, digest = score.seal(truths)
        (self.folder / "truth.sealed").write_text(text)
        (self.folder / "manifest.json").write_text(
            json.dumps({"type": "experiments", "truth_sha256": digest}))

    def cells(self, rows):
        path = self.folder / "mine.csv"
        path.write_text(HEADER + rows)
        done = run("score.py", self.folder, path)
        self.assertEqual(done.returncode, 0, done.stderr)
        return [cell.strip() for cell in done.stdout.splitlines()[2].strip("|").split("|")]

    def refused(self, text):
        path = self.folder / "mine.csv"
        path.write_text(text)
        done = run("score.py", self.folder, path)
        self.assertEqual(done.returncode, 65)
        self.assertEqual(done.stdout.count("\n"), 2)  # the header alone
        return done.stderr

    def test_by_hand(self):
        # Half a point past the peak, 2 % off, within its interval; and a bound that holds.
        self.assertEqual(self.cells("000,4.5,0.098,0.095,0.101,value\n001,,0.11,,,lower_bound\n"),
                         ["mine", "100 % of 2", "100 % of 1", "0 % of 1", "0.50 / 0.50 points",
                          "100 % of 1", "2.00 / 2.00 %", "3.00 / 3.00 %", "100 % of 1", "100 % of 1",
                          "0 % of 1"])
        # Early; a value where friction rises on, and it misses.
        self.assertEqual(self.cells("000,3.1,0.1,0.09,0.11,value\n001,5,0.11,0.105,0.115,value\n")[1:4],
                         ["0 % of 2", "100 % of 1", "100 % of 1"])
        # Late by 1.5 points; a bound that holds.
        self.assertEqual(self.cells("000,5.5,0.1,0.09,0.11,value\n001,,0.11,,,lower_bound\n")[1],
                         "50 % of 2")
        # Interval beside the truth; a bound that does not hold.
        self.assertEqual(self.cells("000,4.1,0.1,0.101,0.11,value\n001,,0.13,,,lower_bound\n")[1],
                         "0 % of 2")

    def test_where_a_reading_was_disturbed_a_stop_without_a_value_is_right(self):
        self.seal({"000": dict(TRUTH, kind="disturbed", disturbed_s=2.0)})
        for row, right in (("000,4.5,,,,none\n", 100), ("000,2.1,,,,none\n", 100), ("000,1.9,,,,none\n", 0),
                           ("000,5.5,,,,none\n", 0), ("000,,,,,none\n", 0),
                           ("000,4.5,0.09,,,lower_bound\n", 100), ("000,4.5,0.11,,,lower_bound\n", 0),
                           ("000,4.5,0.1,0.09,0.11,value\n", 100),
                           ("000,4.5,0.1,0.101,0.11,value\n", 0)):
            self.assertEqual(self.cells(row)[1], f"{right} % of 1", row)

    def test_what_says_nothing_is_not_right(self):
        # Silence, a bound of nothing, an interval as wide as the safety factor and more.
        self.seal({"000": TRUTH, "001": RISING})
        for first, second in (("none", "none"), ("value", "lower_bound")):
            rows = {"none": "{},{},,,,none\n", "value": "{},{},0.1,0.01,0.9,value\n",
                    "lower_bound": "{},{},0,,,lower_bound\n"}
            answers = rows[first].format("000", 4.1) + rows[second].format("001", "")
            self.assertEqual(self.cells(answers)[1], "0 % of 2")
        # 0.1 / 1.3 = 0.0769 and 0.13; 0.12 / 1.3 = 0.0923.
        for low, high, bound, right in ((0.077, 0.13, 0.0924, 100), (0.076, 0.13, 0.0922, 0),
                                        (0.077, 0.131, 0.0922, 0)):
            self.assertEqual(self.cells(f"000,4.1,0.1,{low},{high},value\n"
                                        f"001,,{bound},,,lower_bound\n")[1], f"{right} % of 2")

    def test_says_what_is_wrong_with_answers(self):
        good = "000,,,,,none\n001,,,,,none\n"
        self.assertIn("no row for 001", self.refused(HEADER + "000,,,,,none\n"))
        self.assertIn("002 is not in the manifest", self.refused(HEADER + good + "002,,,,,none\n"))
        self.assertIn("answered twice", self.refused(HEADER + good + "000,,,,,none\n"))
        self.assertIn("mine.csv:2: stop_s: found 'soon'",
                      self.refused(HEADER + "000,soon,,,,none\n001,,,,,none\n"))
        self.assertIn("expected value, lower_bound or none",
                      self.refused(HEADER + "000,,,,,yes\n001,,,,,none\n"))
        self.assertIn("a value needs lo", self.refused(HEADER + "000,1,0.1,,,value\n001,,,,,none\n"))
        self.assertIn("expected id,stop_s", self.refused("id,mu\n"))
        self.assertIn("stop_s: found 'nan'", self.refused(HEADER + "000,nan,,,,none\n001,,,,,none\n"))
        self.assertIn("hi: found 'inf'",
                      self.refused(HEADER + "000,1,0.1,0,inf,value\n001,,,,,none\n"))
        self.assertIn("000: lo 0.2 lies above hi 0.1",
                      self.refused(HEADER + "000,1,0.1,0.2,0.1,value\n001,,,,,none\n"))

    def test_reads_what_a_spreadsheet_writes(self):
        rows = "000,4.5,0.098,0.095,0.101,value\r\n001,,0.11,,,lower_bound\r\n"
        path = self.folder / "mine.csv"
        path.write_bytes(("\ufeff" + HEADER.replace("\n", "\r\n") + rows).encode())
        done = run("score.py", self.folder, path)
        self.assertIn("| mine | 100 % of 2 |", done.stdout)

    def test_says_what_is_wrong_with_the_folder(self):
        answers = self.folder / "mine.csv"
        answers.write_text(HEADER)
        manifest = self.folder / "manifest.json"
        for text, code, said in ((None, 66, "manifest.json: No such file"), ("{", 65, "manifest.json"),
                                 ("{}", 65, "expected what make.py writes"),
                                 ('{"type": "rides", "truth_sha256": ""}', 65, "found 'rides'")):
            manifest.unlink() if text is None else manifest.write_text(text)
            done = run("score.py", self.folder, answers)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (code, 1), done.stderr)
            self.assertIn(said, done.stderr)
        manifest.write_text('{"type": "campaigns", "truth_sha256": ""}')
        done = run("score.py", self.folder, answers, "--by", "noise")
        self.assertEqual(done.returncode, 65)
        self.assertIn("campaigns have no classes", done.stderr)
        for script, arguments, code, said in (
                ("make.py", [self.folder], 73, "expected a new folder"),
                ("make_campaigns.py", [self.folder], 73, "expected a new folder"),
                ("answer.py", [self.folder / "nowhere", "robust"], 66, "expected a folder of make.py"),
                ("answer.py", [self.folder, "robust"], 65, "found campaigns, expected experiments"),
                ("answer_campaigns.py", [self.folder / "nowhere", "usual"], 66, "No such file")):
            done = run(script, *arguments)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (code, 1), done.stderr)
            self.assertIn(said, done.stderr)

    def test_a_truth_that_was_opened_and_changed_is_refused(self):
        text, _ = score.seal({"000": dict(TRUTH, mu_max=0.2)})
        (self.folder / "truth.sealed").write_text(text)
        (self.folder / "mine.csv").write_text(HEADER)
        done = run("score.py", self.folder, self.folder / "mine.csv")
        self.assertEqual(done.returncode, 65)
        self.assertIn("truth.sealed: sha256", done.stderr)


class Document(unittest.TestCase):
    def test_has_the_scorers_columns(self):
        text = (SOURCE / "tools/BENCHMARK.md").read_text()
        tables = [line for line in text.splitlines() if line.startswith("| answers |")]
        expected = ["| " + " | ".join(score.HEADERS[kind]) + " |"
                    for kind in ("experiments", "experiments", "campaigns")]
        self.assertEqual(tables, expected)
        for line in expected[1:]:
            rows = text.split(line)[-1].split("\n\n")[0].splitlines()[2:]
            self.assertGreater(len(rows), 2)
            self.assertEqual({row.count("|") for row in rows}, {line.count("|")})

    def test_tables_take_the_places_of_the_old_ones(self):
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "document.md"
            path.write_text("Seed 1 (abc):\n\n| answers | a |\n|---|---|\n| x | 1 |\n\nText.\n\n"
                            "| | |\n|---|---|\n| kept | 1 |\n\nSeed 1 (abc):\n\n"
                            "| answers | b |\n|---|---|\n| y | 2 |\n| z | 3 |\n")
            document.DOCUMENT = path
            document.write([["| answers | a |\n|---|---|", "| x | 8 |"],
                            ["| answers | b |\n|---|---|", "| y | 9 |"]], "2 (def)")
            self.assertEqual(path.read_text(), "Seed 2 (def):\n\n| answers | a |\n|---|---|\n"
                             "| x | 8 |\n\nText.\n\n| | |\n|---|---|\n| kept | 1 |\n\n"
                             "Seed 2 (def):\n\n| answers | b |\n|---|---|\n| y | 9 |\n")
            with self.assertRaisesRegex(document.recipe.Refused, "1 tables have no place"):
                document.write([["| answers | a |"]] * 3, "2 (def)")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
