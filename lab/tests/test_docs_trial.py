"""The figures in docs/study/grip-trials.md are those of the published run of `holdfast trial`."""

import json

from benchmark_script import ROOT, load

script = load("publish_trial")
PUBLISHED = ROOT / "docs" / "study" / "grip"


def test_the_page_is_what_the_template_gives():
    assert (ROOT / "docs" / "study" / script.PAGE).read_text("utf-8") == script.render(PUBLISHED), (
        "docs/study/grip-trials.md differs: run python benchmarks/publish_trial.py render"
    )


def test_the_readme_quotes_the_published_run():
    laws = json.loads((PUBLISHED / "trial.json").read_text("utf-8"))["laws"]
    sets = json.loads((PUBLISHED / "sets.json").read_text("utf-8"))
    ours, twice = (sets["mild"]["laws"][name] for name in ("holdfast", "fixed-2"))
    readme = (ROOT / "README.md").read_text("utf-8").splitlines()
    row = next(line for line in readme if line.startswith("| Is less dropped?"))
    dropped, force = (
        [f"{law[name]['value']:.1f}" for law in (ours, twice)]
        for name in ("dropped", "force_ratio_mean")
    )
    assert f"| {dropped[0]} %; {force[0]}. " in row
    assert f"twice the first grip: {dropped[1]} %; {force[1]} |" in row
    for name, text in (("taught", "a taught model"), ("any", "calibrated `any`:")):
        assert f"{text} {sets[name]['laws']['holdfast']['dropped']['value']:.1f} %" in row
    rivals = [laws[name] for name in ("pr2", "wong-zhu", "friction-margin")]
    least = ours["force_ratio_mean"]["value"]
    assert all(one["force_ratio_mean"]["value"] > least for one in rivals)
    assert all(one["dropped"]["value"] < ours["dropped"]["value"] for one in rivals)
