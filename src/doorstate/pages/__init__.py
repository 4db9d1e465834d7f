# SPDX-License-Identifier: Apache-2.0
"""HTML pages of clouds: colours, encoded clouds, and templates; a page loads no other file."""
