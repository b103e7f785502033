"""How data_samples/lab_small was made: the first seconds of two runs of the campaign lab_a, at half the resolution.

    python data_samples/make_lab_small.py PATH/TO/lab_a data_samples/lab_small

Area averaging halves the pictures; a pixel (u, v) of the full picture, with (0, 0) the centre of its first pixel, is
((u + 1/2)/2 − 1/2, (v + 1/2)/2 − 1/2) in the half one. Times are kept.
"""

import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import pandas as pd
import yaml

FRAMES = 325
RUNS = ("a", "b")


def halved(pixel):
    """A pixel of the full picture in the half one."""
    return [round((value + 0.5) / 2 - 0.5, 2) for value in pixel]


def cut_video(source, target):
    """The first frames of a video at half the size, with their own times."""
    with av.open(str(source)) as old, av.open(str(target), "w", options={"movflags": "+faststart"}) as new:
        stream_in = old.streams.video[0]
        stream = new.add_stream("libx264", rate=stream_in.average_rate, options={"crf": "19", "preset": "veryslow"})
        stream.width, stream.height, stream.pix_fmt = stream_in.width // 2, stream_in.height // 2, "yuv420p"
        stream.codec_context.time_base = Fraction(stream_in.time_base)
        for number, frame in enumerate(old.decode(stream_in)):
            if number == FRAMES:
                break
            small = cv2.resize(
                frame.to_ndarray(format="bgr24"), (stream.width, stream.height), interpolation=cv2.INTER_AREA
            )
            made = av.VideoFrame.from_ndarray(small, format="bgr24")
            made.pts, made.time_base = frame.pts, frame.time_base
            new.mux(stream.encode(made))
        new.mux(stream.encode())


def main(source, target):
    """Cut and scale the campaign ``source`` into ``target``."""
    (target / "calibration").mkdir(parents=True, exist_ok=True)
    for path in sorted((source / "calibration").glob("*.jpg")):
        picture = cv2.imread(str(path))
        small = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(target / "calibration" / path.name), small, [cv2.IMWRITE_JPEG_QUALITY, 92])
    campaign = yaml.safe_load((source / "campaign.yaml").read_text())
    campaign["camera"]["resolution_px"] = [n // 2 for n in campaign["camera"]["resolution_px"]]
    for key in ("origin_corner_px", "x_axis_end_corner_px"):
        campaign["floor"][key] = halved(campaign["floor"][key])
    campaign["runs"] = {run: campaign["runs"][run] for run in RUNS}
    for run, entry in campaign["runs"].items():
        clicks = entry["first_frame_clicks_px"]
        entry["first_frame_clicks_px"] = {body: [halved(p) for p in clicks[body]] for body in clicks}
        cut_video(source / f"{run}.mp4", target / f"{run}.mp4")
        pd.read_csv(source / f"{run}_truth.csv").head(FRAMES).to_csv(target / f"{run}_truth.csv", index=False)
    text = yaml.safe_dump(campaign, sort_keys=False, default_flow_style=None, width=120)
    (target / "campaign.yaml").write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
