from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.detection import fingertip_force
from holdfast.io import import_recordings
from holdfast.sensors import sensor
from holdfast.twin.steps import saturated
from holdfast.twin.surface import curved_fingertip
from holdfast.twin.uskin import (
    Uskin,
    UskinParameters,
    taxel_shares,
    with_server_effects,
)

TIP = sensor("uskin-curved")
SKIN = curved_fingertip()
REAL = UskinParameters()
IDEAL = UskinParameters(
    gain_spread=0.0,
    cross_talk=0.0,
    lag_shares=(0.0, 0.0),
    baseline=(32768.0, 32768.0, 36000.0),
    baseline_spread=(0.0, 0.0, 0.0),
    thermal_counts=(0.0, 0.0, 0.0),
    thermal_spread=0.0,
    warming=0.0,
    noise_counts=0.0,
)
RATE = 150.0


def tip(parameters=REAL, seed=0):
    return Uskin(parameters, TIP, SKIN.nodes, np.random.default_rng(seed))


def clock(seconds):
    return np.arange(round(seconds * RATE) + 1) / RATE


def on_z(course):
    """Taxel forces (n, 30, 3) that follow a course on every taxel's z."""
    return np.asarray(course)[:, None, None] * np.tile([0.0, 0.0, 1.0], (TIP.n_taxels, 1))


def newtons(parameters, course, times):
    """What an ideal taxel shows for a course of z [N], to half a count."""
    counts = tip(parameters).counts(on_z(course), times)
    return (counts[:, 0, 2] - IDEAL.baseline[2]) / parameters.counts_per_newton[2]


SILICONE = replace(IDEAL, lag_shares=REAL.lag_shares, limits=(1e3, 1e3, 1e3))


def test_shares_are_a_partition_of_unity():
    shares = taxel_shares(SKIN.nodes, TIP.positions, REAL.spread)
    assert shares.shape == (len(SKIN.nodes), 30)
    assert (shares >= 0).all()
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-14)
    assert (shares.sum(axis=0) > 1.0).all()  # every taxel has some nodes


def test_a_node_on_a_taxel_is_mostly_its_own_and_walls_do_not_couple():
    shares = taxel_shares(TIP.positions, TIP.positions, REAL.spread)
    assert (np.diag(shares) > 0.7).all()
    walls = np.abs(TIP.positions[:, 1]) > 0.014
    across = TIP.positions[walls, 1][:, None] * TIP.positions[walls, 1] < 0
    assert across.any()
    assert shares[np.ix_(walls, walls)][across].max() < 1e-12


def test_shares_fall_as_a_bell_over_the_distance():
    near, far = taxel_shares([[0.0, 0, 0]], [[1e-3, 0, 0], [0, 0, 5e-3]], 2.8e-3)[0]
    assert near / far == pytest.approx(np.exp((5.0**2 - 1.0**2) / (2 * 2.8**2)))


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e2))
def test_taxel_forces_sum_to_the_force_on_the_object(seed, scale):
    forces = scale * np.random.default_rng(seed).normal(size=(3, len(SKIN.nodes), 3))
    on_taxels = tip().taxel_forces(forces)
    total = np.einsum("iab,kib->ka", TIP.rotations, on_taxels)
    np.testing.assert_allclose(total, -forces.sum(axis=1), atol=1e-12 * scale * len(SKIN.nodes))


def test_a_pressed_pad_reads_positive():
    """The object pushes the pad's middle inwards, against x; the readings are +z and +F_x."""
    pad = np.linalg.norm(SKIN.nodes - [0.0257, 0.0, 0.0168], axis=1) < 3e-3
    forces = np.zeros((2, len(SKIN.nodes), 3))
    forces[1, pad, 0] = -2.0 / pad.sum()
    uskin = tip(IDEAL)
    on_taxels = uskin.taxel_forces(forces)
    assert on_taxels[1, :, 2].max() > 0.3
    counts = uskin.counts(on_taxels, [0.0, 1.0])
    force = fingertip_force(counts, TIP, tare="first")[1]
    assert force[0] == pytest.approx(2.0 / 0.000729, rel=0.05)
    assert abs(force[1]) < 0.02 * force[0]
    assert abs(force[2]) < 0.05 * force[0]


@pytest.mark.parametrize(("axis", "newton_per_count"), [(0, 628e-6), (1, 628e-6), (2, 729e-6)])
@pytest.mark.parametrize("newton", [0.1, -0.1])
def test_scale_is_that_of_the_data_sheet(axis, newton_per_count, newton):
    forces = np.zeros((1, 30, 3))
    forces[0, 4, axis] = newton
    counts = tip(IDEAL).counts(forces, [0.0]).astype(float) - IDEAL.baseline
    expected = np.zeros((30, 3))
    expected[4, axis] = round(newton / newton_per_count)
    assert counts[0].tolist() == expected.tolist()


@given(st.floats(-1e3, 1e3), st.floats(0.0, 10.0), st.sampled_from(REAL.limits))
def test_saturation_is_odd_monotone_and_never_passes_the_limits(newton, step, limit):
    low, high = saturated(newton, limit), saturated(newton + step, limit)
    assert low <= high + 1e-12
    assert abs(high) <= limit * (1 + 1e-12)
    assert saturated(-newton, limit) == -low


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_taxel_reads_no_more_than_its_range(axis):
    forces = np.zeros((2, 30, 3))
    forces[1, :, axis] = 50.0
    counts = tip(IDEAL).counts(forces, [0.0, 1.0]).astype(float)
    assert (counts[1] - counts[0])[:, axis] == pytest.approx([1385, 1385, 10082][axis], abs=1)


def test_step_response_shows_both_lags():
    times = clock(12.0)
    start = 1 / RATE  # a force rises within one sample: later parts see it half a sample late
    read = newtons(SILICONE, np.where(times >= start, 2.0, 0.0), times) / 2.0
    since = times - start / 2
    fast, slow = SILICONE.lag_shares
    expected = 1 - fast * np.exp(-since / 0.030) - slow * np.exp(-since / 2.0)
    np.testing.assert_allclose(read[1:], expected[1:], atol=3e-3)
    assert read[0] == 0.0
    assert read[1] == pytest.approx(0.86, abs=0.01)
    assert read[-1] == pytest.approx(1.0, abs=5e-4)


def loop(ramp):
    """Largest opening between loading and unloading, over the height of the cycle."""
    times = clock(2 * ramp)
    course = 4.0 * (1 - np.abs(times / ramp - 1))
    read = newtons(SILICONE, course, times)
    n = len(times) // 2
    return np.max(read[n:] - read[n::-1]) / 4.0


def test_hysteresis_of_a_slow_cycle_is_that_of_the_data_sheet():
    assert loop(20.0) == pytest.approx(0.0106, abs=0.001)


def test_a_force_that_rests_is_read_in_full_from_the_first_sample():
    read = newtons(SILICONE, np.full(300, 1.5), clock(2.0)[:300])
    np.testing.assert_allclose(read, 1.5, atol=1.5e-3)
    assert np.ptp(read) == 0.0


@pytest.mark.parametrize("noise", [0.9, 0.5, 3.0])
def test_noise_is_that_asked_for_rounding_included(noise):
    still = replace(REAL, noise_counts=noise, warming=0.0)
    counts = tip(still).counts(np.zeros((4000, 30, 3)), np.arange(4000) / RATE).astype(float)
    rms = counts.std(axis=0)
    assert np.sqrt((rms**2).mean()) == pytest.approx(noise, rel=0.01)
    steps = np.diff(counts, axis=0).std(axis=0) / np.sqrt(2)
    assert np.sqrt((steps**2).mean()) == pytest.approx(noise, rel=0.01)  # white


@pytest.mark.slow
def test_drift_over_50_minutes_is_that_of_the_data_sheet():
    """Standard deviation of z over many runs: 3.5 K and 120 counts, x and y hardly any."""
    times = np.arange(0.0, 3000.1, 10.0)
    uskin = tip(replace(REAL, noise_counts=0.0, thermal_spread=0.0))
    warmths = []
    for seed in range(300):
        run = uskin.readout(np.random.default_rng(seed))
        counts = run.read(np.zeros((len(times), 30, 3)), times).astype(float)
        moved = counts[-1] - counts[0]
        drift = moved[:, 2].mean()
        assert moved[:, 2] == pytest.approx(drift, abs=1.01)
        assert not moved[:, :2].any()
        warmths.append(drift * 3.5 / 120)
    assert np.std(warmths) == pytest.approx(3.5, rel=0.12)
    assert abs(np.mean(warmths)) < 0.7


READ_IN_TURN = replace(REAL, n_averaged=3, scan_time=0.012, noise_by_axis=(1.0, 1.0, 2.0))
COLOURED = replace(READ_IN_TURN, slow_share=0.7, walk=0.8, step=3, still_share=0.2)


@given(
    st.lists(st.integers(1, 40), min_size=1, max_size=8),
    st.integers(0, 1000),
    st.sampled_from([REAL, READ_IN_TURN, COLOURED]),
)
def test_fed_in_pieces_it_sends_the_same(pieces, seed, parameters):
    n = sum(pieces)
    generator = np.random.default_rng(seed)
    forces = generator.normal(size=(n, 30, 3))
    times = np.cumsum(generator.uniform(1e-3, 2e-2, n))
    whole = tip(parameters, seed=seed).counts(forces, times)
    run = tip(parameters, seed=seed).readout()
    cuts = np.cumsum(pieces)[:-1]
    parts = [run.read(*p) for p in zip(np.split(forces, cuts), np.split(times, cuts), strict=True)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("step", [1, 7])
def test_readings_are_multiples_of_the_step(step):
    counts = tip(replace(REAL, noise_counts=9.0, step=step)).counts(
        np.zeros((500, 30, 3)), np.arange(500) / RATE
    )
    assert not (counts % step).any()
    assert np.gcd.reduce(counts.ravel().astype(int)) == step


def test_still_taxels_have_no_noise_and_still_feel_forces():
    skin = tip(replace(IDEAL, noise_counts=3.0, still_share=0.3, limits=(1e3, 1e3, 1e3)))
    times = clock(2.0)
    counts = skin.counts(on_z(0.5 * (times > 1)), times).astype(float)
    before = counts[times <= 1]
    still = (before == before[0]).all(axis=(0, 2))
    assert 1 <= still.sum() <= 20
    risen = (counts[-1] - counts[0])[still, 2]
    np.testing.assert_allclose(risen, 0.5 * IDEAL.counts_per_newton[2], atol=1.0)


def test_taxels_that_are_read_in_turn_show_a_ramp_one_after_the_other():
    """Taxel i of a line of n was read (i + 1/2) / n of the scan after the scan began."""
    scan, line = 1 / RATE, 5
    times = clock(0.5)
    skin = tip(replace(IDEAL, scan_time=scan, scan_line=line, limits=(1e3, 1e3, 1e3)))
    at_once = tip(replace(IDEAL, limits=(1e3, 1e3, 1e3)))
    ramp = on_z(20.0 * times)
    late = at_once.counts(ramp, times).astype(float) - skin.counts(ramp, times)
    ages = late[10:, :, 2].mean(axis=0) / (20.0 * IDEAL.counts_per_newton[2])
    expected = scan * (1 - (np.arange(TIP.n_taxels) % line + 0.5) / line)
    np.testing.assert_allclose(ages, expected, atol=1e-4)
    assert (late[1:, :, 2] > 0).all()
    assert not late[:, :, :2].any()


@pytest.mark.parametrize(
    ("forces", "times", "message"),
    [
        (np.zeros((2, 29, 3)), [0, 1], r"shape \(n, 30, 3\) and n times .* \(2, 29, 3\)"),
        (np.zeros((2, 30, 3)), [0], r"\(2, 30, 3\) and \(1,\) given"),
        (np.full((2, 30, 3), np.nan), [0, 1], "finite taxel forces and times expected"),
        (np.zeros((2, 30, 3)), [0, np.inf], "finite taxel forces and times expected"),
        (np.zeros((2, 30, 3)), [1, 1], "increasing times expected"),
    ],
)
def test_bad_samples_are_refused(forces, times, message):
    with pytest.raises(ValueError, match=message):
        tip().counts(forces, times)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("noise_counts", -1.0),
        ("spread", 0.0),
        ("limits", (1.0, float("nan"), 1.0)),
        ("limits", (1.0, 1.0)),
        ("lag_shares", (0.6, 0.5)),
        ("n_averaged", 0),
        ("n_averaged", 1.5),
        ("scan_time", -0.01),
        ("slow_share", 1.1),
        ("slow_time", 0.0),
        ("step", 0),
        ("step", 2.5),
        ("still_share", 2.0),
    ],
)
def test_bad_parameters_are_refused(field, value):
    with pytest.raises(ValueError, match=f"{field}: "):
        replace(REAL, **{field: value})


@given(st.integers(2, 400), st.integers(0, 1000), st.floats(0, 0.1))
def test_server_times_increase_and_packets_stay_in_order(n, seed, jitter):
    times = np.arange(n) / RATE
    stamps, sent = with_server_effects(
        times, np.arange(n), np.random.default_rng(seed), jitter=jitter
    )
    assert (np.diff(stamps) > 0).all()
    assert np.abs(stamps - times).max() < 0.46 / RATE
    assert set(np.diff(sent).tolist()) <= {0, 1, 2}
    assert not ((np.diff(sent)[1:] == 0) & (np.diff(sent)[:-1] == 0)).any()
    assert (sent <= np.arange(n)).all()  # nothing is sent before it is measured


@pytest.mark.parametrize(
    ("times", "jitter", "share", "message"),
    [
        ([0, 1], -1.0, 0.1, "jitter"),
        ([0, 1], float("nan"), 0.1, "jitter"),
        ([0, 1], 0.0, 0.5, "repeats"),
        ([1, 1], 0.0, 0.1, "increasing"),
        ([0, 1, 2], 0.0, 0.1, r"\(3,\)"),
    ],
)
def test_bad_server_effects_are_refused(times, jitter, share, message):
    with pytest.raises(ValueError, match=message):
        with_server_effects(times, np.zeros((2, 3)), np.random.default_rng(0), jitter, share)


def test_server_effects_are_like_those_of_a_real_server(data_folder):
    """Five recordings at 60 Hz: share of repeats, none twice, spread of the steps in time."""
    repeats, spreads = [], []
    for recording in import_recordings(data_folder / "uskin_pick_move"):
        module = recording.modules["finger1"]
        same = (np.diff(module.readings.astype(int), axis=0) == 0).all(axis=(1, 2))
        assert not (same[1:] & same[:-1]).any()
        repeats.append(same.mean())
        spreads.append(np.diff(module.times).std())
    n = 20_000
    stamps, sent = with_server_effects(np.arange(n) / 60, np.arange(n), np.random.default_rng(0))
    assert min(repeats) < (np.diff(sent) == 0).mean() < max(repeats)
    assert min(spreads) < np.diff(stamps).std() < max(spreads)
