"""store.js: storage of constant size, and downsampling for plots."""

import pytest

# A store of `capacity` samples that takes samples k = 0, 1, ... of value k at 100 Hz.
STORE = """async ([capacity, chunks, bins, window]) => {
  const { SampleStore, downsample } = await import("/page/store.js");
  const store = new SampleStore(["a"], capacity);
  const size = () => store.arrays().reduce((sum, array) => sum + array.byteLength, 0);
  const before = size();
  let k = 0;
  for (const n of chunks) {
    const indices = Array.from({ length: n }, () => k++);
    const own = { force: [indices, indices, indices],
                  instability: indices.map((p) => p % 1000 === 77 ? 2 ** 33 : p),
                  stable_probability: indices.map(() => null), state: indices.map((p) => p % 4) };
    store.append({ times: indices.map((p) => p / 100), fingers: { a: own } }, 3, 0.05);
  }
  const a = store.fingers.get("a"), kept = (array) => [...array.subarray(store.start, store.end)];
  const { x, columns } = downsample(store, window, bins, [a.fx, a.sigma, a.probability]);
  return { times: kept(store.times), fx: kept(a.fx), state: kept(a.state), hand: kept(store.hand),
           same: before === size(), x, columns };
}"""
FEED = """async ([parts, gap]) => {
  const { SampleStore, downsample } = await import("/page/store.js");
  const store = new SampleStore(["a"], 100);
  for (const times of parts) {
    const values = times.map(() => 1);
    const own = { force: [values, values, values], state: times.map(() => 3) };
    store.append({ times, fingers: { a: own } }, 3, gap);
  }
  const { x, columns } = downsample(store, 100, 500, [store.fingers.get("a").fx]);
  return [x, columns[0]];
}"""


@pytest.mark.parametrize("chunks", [[1000], [7] * 143, [1] * 205, [99, 1, 100, 250, 3], [50]])
def test_the_store_keeps_the_newest_samples_for_any_chunks(module, chunks):
    found = module.evaluate(STORE, [100, chunks, 1000, 100])
    n = sum(chunks)
    newest = list(range(max(0, n - 100), n))
    assert found["fx"] == newest
    assert found["times"] == pytest.approx([k / 100 for k in newest])
    assert found["state"] == [k % 4 for k in newest]
    assert found["hand"] == [3] * len(newest)
    assert found["same"]


@pytest.mark.parametrize("n", [4000, 4001, 4013, 9999])
def test_bins_keep_short_peaks_and_their_order(module, n):
    found = module.evaluate(STORE, [12000, [n], 300, 30])
    assert len(found["x"]) <= 2 * 301
    assert found["x"] == sorted(found["x"])
    # One sample of each thousand is huge.
    first = max(0, n - 3000)
    assert found["columns"][1].count(2**33) == len([k for k in range(first, n) if k % 1000 == 77])
    assert found["columns"][0] == sorted(found["columns"][0])


@pytest.mark.parametrize(
    ("parts", "x", "values"),
    [
        ([[0, 0.01], [0.5, 0.51]], [-0.51, -0.5, -0.255, -0.01, 0], [1, 1, None, 1, 1]),
        # A source that falls silent gives an estimate at the time of its last sample.
        ([[0, 0.01], [0.01], [0.02]], [-0.02, -0.01, -0.01, 0], [1, 1, 1, 1]),
        # Times that go back are those of another recording.
        ([[5, 5.01, 5.02], [0, 0.01]], [-0.01, 0], [1, 1]),
    ],
    ids=["gap", "silence", "restart"],
)
def test_lines_of_parts(module, parts, x, values):
    assert module.evaluate(FEED, [parts, 0.05]) == [pytest.approx(x), values]


def test_a_gap_in_a_bin_draws_no_line_across_it(module):
    """A bin that begins with the gap has its value after it, not at the time of the gap."""
    script = """async (n) => {
      const { SampleStore, downsample } = await import("/page/store.js");
      const store = new SampleStore(["a"], 1000);
      for (const [first, value] of [[0, 9], [100, 1]]) {
        const times = Array.from({ length: n }, (_, k) => first + k);
        const values = times.map(() => value);
        const own = { force: [values, values, values], state: times.map(() => 3) };
        store.append({ times, fingers: { a: own } }, 3, 5);
      }
      const { x, columns: [fx] } = downsample(store, 1000, 20, [store.fingers.get("a").fx]);
      const from = x.findLastIndex((t, k) => t < -n && fx[k] === 9), to = fx.indexOf(1);
      return [fx.slice(from + 1, to).includes(null), x[to] >= -n];
    }"""
    for n in range(60, 68):
        assert module.evaluate(script, n) == [True, True]


@pytest.mark.parametrize(("rate", "capacity"), [("null", 12000), (150, 12000), (5000, 60000)])
def test_the_capacity_follows_the_rate_within_bounds(module, rate, capacity):
    script = f"import('/page/store.js').then((m) => m.capacityFor({rate}))"
    assert module.evaluate(script) == capacity


def test_fingers_sampled_in_turn_have_lines_without_gaps(module):
    found = module.evaluate("""async () => {
      const { SampleStore } = await import("/page/store.js");
      const store = new SampleStore(["a", "b"], 100);
      const track = (own) => ({ force: [own, own, own],
                                state: own.map((v) => v === null ? null : 3) });
      const times = [0, 0.01, 0.02, 0.03, 0.04, 0.3];
      const a = track([0, null, 2, null, 4, null]), b = track([null, 1, null, 3, null, 5]);
      store.append({ times, fingers: { a, b } }, 3, 0.05);
      const plain = (values) => values.map((v) => Number.isNaN(v) ? null : v);
      return ["a", "b"].map((name) => ["fx", "state"].map(
        (key) => plain([...store.fingers.get(name)[key].subarray(0, 6)])));
    }""")
    # The last comes after a gap, and the first has nothing before it.
    assert found == [
        [[0, 0, 2, 2, 4, None], [3, 3, 3, 3, 3, 0]],
        [[None, 1, 1, 3, 3, 5], [0, 3, 3, 3, 3, 3]],
    ]
