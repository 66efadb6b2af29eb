"""Calibration by own handling, over the web service."""

from holdfast.model import Model
from live.web.test_service import patient, run, served, wait_for
from training.build import handling_recording, normalised_model


def handled(held=14.0, **options):
    recording = handling_recording(3, held=held, **options)
    return patient(10**6, recording)


async def call(client, method, path, body=None):
    async with client.request(method, f"/api/v1/{path}", json=body) as answer:
        return answer.status, await answer.json()


def calibrated(source, tmp_path, then, **options):
    """Return what `then(client, session)` returns after a calibration with a source."""

    async def work():
        model = options.pop("model", normalised_model())
        async with served(source, folder=tmp_path, start=False, model=model, **options) as (
            client, session,
        ):  # fmt: skip
            started = await call(client, "POST", "calibration")
            assert started[0] == 200
            assert started[1]["state"] == "recording"
            session.start()
            try:
                await wait_for(lambda: not source.steps)
                assert (await call(client, "POST", "calibration/finish"))[0] == 200
                document = {"state": "fitting"}
                while document["state"] == "fitting":
                    _, document = await call(client, "GET", "calibration")
                return await then(client, session, document)
            finally:
                session.stop()

    return run(work())


def test_a_calibration_is_applied_saved_and_undone(tmp_path):
    reports = []

    async def then(client, session, document):
        assert document["calibrated"]
        assert (document["least"], document["enough"], document["most"]) == (5.5, 30.0, 60.0)
        _, info = await call(client, "GET", "info")
        assert info["model"] == "builtin:any, calibrated"
        limit = session.stream.model.fingers["*"].handling["pad"].thresholds["stable"]
        assert info["fingers"]["thumb"]["probability_threshold"] == limit
        status, saved = await call(client, "POST", "calibration/model", {"name": "mine"})
        assert (status, saved) == (200, {"path": str(tmp_path / "mine.json")})
        assert Model.load(saved["path"]) == session.stream.model
        status, again = await call(client, "POST", "calibration/model", {"name": "mine"})
        assert status == 409
        assert "mine.json" in again["error"]
        status, wrong = await call(client, "POST", "calibration/model", {"name": "../mine"})
        assert status == 409
        assert wrong["error"].startswith("a name of letters, digits, _, - and . expected")
        async with client.get("/api/v1/calibration/model") as answer:
            assert 'filename="calibrated.json"' in answer.headers["Content-Disposition"]
            (tmp_path / "got.json").write_bytes(await answer.read())
        assert Model.load(tmp_path / "got.json") == session.stream.model
        async with client.ws_connect("/api/v1/live") as socket:
            await socket.receive_json()
            live = await socket.receive_json()
        assert live["calibration"]["calibrated"]
        await wait_for(lambda: reports)
        # In one request: the source sends nothing any more, but the session still answers.
        status, undone = await call(client, "DELETE", "calibration")
        assert (status, undone["calibrated"], undone["text"]) == (200, False, "calibration undone")
        assert session.stream.model == normalised_model()
        return reports

    texts = calibrated(handled(), tmp_path, then, reports=reports)
    assert texts[0].startswith("pad: held 1")


def test_a_refusal_is_one_line_and_changes_nothing(tmp_path):
    async def then(client, session, document):
        assert (document["calibrated"], document["refused"]) == (False, True)
        assert session.stream.model == normalised_model()
        status, answer = await call(client, "POST", "calibration/model", {})
        assert (status, answer["error"]) == (409, "there is no calibrated model: calibrate first")
        return document["text"]

    text = calibrated(handled(held=8.0, slip=0.95), tmp_path, then)
    assert "looks like slip" in text
    assert "\n" not in text
    assert list(tmp_path.iterdir()) == []


def test_it_is_locked_while_a_hand_is_armed(tmp_path):
    async def work():
        async with served(handled(), folder=tmp_path, model=normalised_model()) as (
            client, session,
        ):  # fmt: skip
            session.lock = "the hand is armed"
            return [
                await call(client, "POST", "calibration"),
                await call(client, "DELETE", "calibration"),
            ]

    start, undo = run(work())
    assert start == (409, {"error": "the hand is armed"})
    assert undo[0] == 409


def test_requests_without_a_calibration_say_so():
    async def work():
        async with served(handled(), model=normalised_model()) as (client, _):
            return [
                await call(client, "POST", "calibration/finish"),
                await call(client, "DELETE", "calibration"),
                await call(client, "GET", "calibration/model"),
            ]

    texts = [(status, answer["error"]) for status, answer in run(work())]
    assert texts == [
        (409, "no calibration is running: start one, and hold an object"),
        (409, "there is no calibration to undo"),
        (409, "there is no calibrated model: calibrate first"),
    ]


def test_the_first_document_says_whether_the_model_can_be_calibrated():
    async def work(model):
        async with served(patient(10), model=model) as (client, _):
            return (await call(client, "GET", "info"))[1]["not_calibratable"]

    assert run(work(Model.load("builtin:any"))) == ""
    text = run(work(Model.load("builtin:twin")))
    assert text.endswith("cannot be calibrated; builtin:any can")


def test_own_handling_of_another_sensor_is_advice(tmp_path):
    async def then(client, session, _):
        model = session.stream.model
        assert (await call(client, "GET", "info"))[1]["advice"] == []
        return model

    model = calibrated(handled(), tmp_path, then)

    async def work():
        async with served(patient(10), model=model) as (client, _):  # curved fingertips
            return (await call(client, "GET", "info"))[1]["advice"]

    (advice,) = run(work())
    assert advice.endswith(
        "was calibrated on pad, not on uskin-curved: default handling is used (holdfast calibrate)"
    )
