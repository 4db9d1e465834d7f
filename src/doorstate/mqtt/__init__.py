# SPDX-License-Identifier: Apache-2.0
"""States of doors on MQTT, for home automation and camera systems: docs/mqtt.md has the topics."""
