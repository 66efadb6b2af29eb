# Write a submission to the benchmark with another program than holdfast: awk, on CSV tables.
#
#   holdfast export benchmark/tuning csv/tuning --format csv
#   holdfast export benchmark/new-objects csv/new-objects --format csv
#   awk -f benchmarks/submission.awk csv/tuning/*.csv csv/new-objects/*.csv > rule.csv
#   holdfast study score rule.csv --benchmark benchmark/
#
# The rule: the force of a stable contact does not change. It sums the readings of all taxels,
# without their rotations, and needs a tare without contact and readings in counts. It shows the
# columns of a submission; it is no method of the study.

BEGIN {
    FS = ","
    N_TARE = 75       # samples of the tare, 0.5 s at 150 Hz
    N_WINDOW = 15     # samples in which the largest change counts
    CONTACT = 25      # force from which on a finger touches [count]
    SCALE = 30        # change at which both scores are a half [count]
    print "recording,finger,sample,stable,slip"
}

/^#/ { next }

FILENAME != file { file = FILENAME; start_of_file() }

$1 == "time" { read_header(); next }

{
    for (f = 1; f <= n_fingers; f++) score(f)
    sample++
}

# The split is the folder, the recording is the name of the file.
function start_of_file(    parts, n) {
    n = split(FILENAME, parts, "/")
    sub(/\.csv$/, "", parts[n])
    recording = parts[n - 1] "/" parts[n]
    n_fingers = sample = 0
}

# Columns of taxels are FINGER.tNN.AXIS.
function read_header(    k, parts, finger) {
    split("", finger_at); split("", axis_at); split("", number)
    for (k = 2; k <= NF; k++) {
        if (split($k, parts, ".") != 3) continue
        finger = parts[1]
        if (!(finger in number)) { number[finger] = ++n_fingers; name[n_fingers] = finger }
        finger_at[k] = number[finger]
        axis_at[k] = parts[3]
    }
    split("", tare); split("", last); split("", change)
}

function score(f,    k, axis, sum, force, late) {
    for (k in finger_at) if (finger_at[k] == f) sum[axis_at[k]] += $k
    for (axis in sum) {
        if (sample < N_TARE) tare[f, axis] += sum[axis] / N_TARE
        force += (sum[axis] - tare[f, axis]) ^ 2
    }
    force = sqrt(force)
    change[f, sample % N_WINDOW] = force > last[f] ? force - last[f] : last[f] - force
    last[f] = force
    for (k = 0; k < N_WINDOW; k++) if (change[f, k] > late) late = change[f, k]
    if (sample < N_TARE + N_WINDOW || force < CONTACT) force = late = 0
    print_row(f, force ? SCALE / (SCALE + late) : 0, late / (SCALE + late))
}

function print_row(f, stable, slip) {
    printf "%s,%s,%d,%.4f,%.4f\n", recording, name[f], sample, stable, slip
}
