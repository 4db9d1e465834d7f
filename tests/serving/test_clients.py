# SPDX-License-Identifier: Apache-2.0
"""Names of clients, and the credit that failures take from them."""

from __future__ import annotations

import pytest

from doorstate.serving.clients import _MAX_CLIENTS, Credit, client_of_address


@pytest.mark.parametrize(
    ("address", "client"),
    [
        ("192.168.1.7", "192.168.1.7"),
        ("::ffff:192.168.1.7", "192.168.1.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::1", "2001:db8:1:2::/64"),
        ("2001:db8:1:3::1", "2001:db8:1:3::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", ""),
        ("testclient", "testclient"),
    ],
)
def test_client_is_an_address_or_a_network(address: str, client: str) -> None:
    assert client_of_address(address) == client


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_failures_take_credit_that_time_and_success_give_back() -> None:
    clock = Clock()
    credit = Credit(most_s=1.0, refill=0.1, clock=clock)
    credit.change("a", -0.9)
    assert credit.seconds_in_debt("a") == 0
    credit.change("a", -0.6)
    assert credit.seconds_in_debt("a") == 5
    assert credit.seconds_in_debt("b") == 0, "another client"
    clock.now += 4
    assert credit.seconds_in_debt("a") == 1
    credit.change("a", 0.2)
    assert credit.seconds_in_debt("a") == 0
    credit.change("a", 100)
    credit.change("a", -1.5)
    assert credit.seconds_in_debt("a") == 5, "credit has a highest value"
    credit.change("a", -100)
    assert credit.seconds_in_debt("a") == 30, "and so has a debt"


def test_clients_are_forgotten() -> None:
    clock = Clock()
    credit = Credit(most_s=1.0, refill=0.1, clock=clock)
    for number in range(3 * _MAX_CLIENTS):
        clock.now += 0.001
        credit.change(str(number), -2.0)
    assert len(credit._credits) <= _MAX_CLIENTS
    assert credit.seconds_in_debt(str(3 * _MAX_CLIENTS - 1)) > 0
