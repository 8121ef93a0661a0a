# SPDX-License-Identifier: Apache-2.0
"""The report of speed against error: measured part by part into JSON, then drawn from it."""
