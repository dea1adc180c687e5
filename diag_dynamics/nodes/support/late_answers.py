# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Answers of a service that are sent after its callback is over: rclpy's EventsExecutor takes no coroutines for callbacks."""


class LateAnswers:
    """Puts off the response of one request at a time; the callback returns it nevertheless, filled in or not.

    Parameters
    ----------
    service : rclpy.service.Service
        Executors send what its callback returns by its method `send_response`, which goes through here from now on.
    """

    def __init__(self, service):
        self._send_now, self._awaited, self._header = service.send_response, None, None
        service.send_response = self._send

    @property
    def awaited(self):
        """The response that was put off; None without any."""
        return self._awaited

    def put_off(self, response):
        """Do not send this response when the callback returns it."""
        self._awaited = response

    def send(self, response):
        """Send a response to the request whose response was put off."""
        header, self._awaited, self._header = self._header, None, None
        self._send_now(response, header)

    def _send(self, response, header):
        if response is self._awaited:
            self._header = header
        else:
            self._send_now(response, header)
