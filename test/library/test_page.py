# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page, as far as Python makes it: frames, scenes, contact, and what its server sends over real connections."""

import base64
import gzip
import json

import numpy as np

import page_fixture


def require_same(found, expected, where="fixture"):
    """Require equal JSON; numbers and packed bytes may differ by rounding."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys(), where
        for name in expected:
            require_same(found[name], expected[name], f"{where}.{name}")
    elif isinstance(expected, list):
        assert len(found) == len(expected), where
        for k, pair in enumerate(zip(found, expected, strict=True)):
            require_same(*pair, f"{where}[{k}]")
    elif isinstance(expected, float):
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9, err_msg=where)
    else:
        assert found == expected, where


def unpacked(text):
    """Bytes of a text, without the compression, which each version of zlib does in its own way."""
    data = base64.b64decode(text)
    return gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data


def numbers_of(frame):
    """Time and numbers of a frame."""
    return [float(np.frombuffer(frame, "<f8", 1)[0]), *np.frombuffer(frame, "<f4", offset=8).astype(float).tolist()]


def test_the_fixture_of_the_javascript_tests_is_what_python_writes():
    """If this fails after a change of frames or packing: python3 test/support/page_fixture.py, then node --test web/test."""
    stored, made = json.loads(page_fixture.PATH.read_text(encoding="utf-8")), page_fixture.content()
    for one in (stored, made):
        one["frames"] = [numbers_of(unpacked(text)) for text in one["frames"]]
        one["columns"]["data"], one["times"], one["mesh"] = (
            unpacked(text).hex() for text in (one["columns"]["data"], one["times"], one["mesh"])
        )
        one["tracks"]["blocks"] = [len(unpacked(text)) for text in one["tracks"]["blocks"]]
    require_same(made, stored)
