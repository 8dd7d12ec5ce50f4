#!/usr/bin/env python3
"""Keypoints of a video by RTMLib, as the JSON that `ivv sound localize` reads (that of MMPose's inferencer).

    python3 tools/rtmlib_to_json.py VIDEO -o CAPTURE/keypoints/CAMERA.json [--mode balanced] [--device cpu]

Needs `pip install rtmlib opencv-python`; RTMLib fetches its networks at the first run. VIDEO may also be a folder of images,
taken in the order of their names. The points are those of COCO-WholeBody, 133 for each person. Written after RTMLib's source
(`rtmlib/tools/solution/wholebody.py`): its networks are not in reach of the tests.
"""

import argparse
import json
import os
import sys
from pathlib import Path


def frames(source):
    """The pictures of a video or a folder, in order."""
    import cv2

    if source.is_dir():
        for name in sorted(os.listdir(source)):
            picture = cv2.imread(str(source / name))
            if picture is None:
                sys.exit(f"{source / name}: is no picture")
            yield picture
        return
    video = cv2.VideoCapture(str(source))
    if not video.isOpened():
        sys.exit(f"{source}: is no video that OpenCV reads")
    while True:
        there, picture = video.read()
        if not there:
            return
        yield picture


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--mode", default="balanced", choices=["lightweight", "balanced", "performance"])
    parser.add_argument("--device", default="cpu", choices=["cpu", "cuda", "mps"])
    args = parser.parse_args()
    try:
        from rtmlib import Wholebody
    except ImportError:
        sys.exit("RTMLib is missing: pip install rtmlib opencv-python")
    detect = Wholebody(mode=args.mode, to_openpose=False, backend="onnxruntime", device=args.device)
    clip = []
    for number, picture in enumerate(frames(args.source)):
        # Asked for the points of nobody, RTMLib takes the whole picture for a person.
        boxes = detect.det_model(picture)
        keypoints, scores = detect.pose_model(picture, bboxes=boxes) if len(boxes) else ([], [])
        persons = [{"keypoints": k.tolist(), "keypoint_scores": s.tolist()} for k, s in zip(keypoints, scores)]
        clip.append({"frame_id": number, "instances": persons})
    if not clip:
        sys.exit(f"{args.source}: holds no picture")
    args.output.parent.mkdir(parents=True, exist_ok=True)
    temporary = args.output.with_name(f".{args.output.name}.{os.getpid()}.tmp")
    temporary.write_text(json.dumps(clip))
    os.replace(temporary, args.output)
    print(f"{args.output}: {len(clip)} frames, {sum(len(frame['instances']) for frame in clip)} persons")


if __name__ == "__main__":
    main()
