# Everything happens in .venv, from hash-pinned requirements: `make run` and `make test` on a bare machine are all the set-up.
PYTHON ?= python3
JSON ?= bench.json
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input install --quiet
COMPILE := $(BIN)/uv pip compile pyproject.toml --quiet --universal --python-version 3.11 --fork-strategy fewest \
	--generate-hashes --no-annotate --custom-compile-command "make constraints" $(ARGS)

help: ## list the targets; ARGS="…" is passed on to the command behind a target
	@sed -n 's/^\([a-z]*\):[^#]*## \(.*\)/make \1\t\2/p' Makefile | expand -t 18
run: .venv/.run ## start the service on the simulated camera: make run ARGS="--duration 20", ARGS=my-rig.toml
	@$(BIN)/abs-service run $(ARGS)
test: .venv/.all ## the tests without the slow ones: make test ARGS="tests/calib -x"
	@OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n $$(($$(nproc) + 1)) --dist loadfile --max-worker-restart 0 -m "not slow and not hardware" $(ARGS)
check: lint test ## everything a change has to pass
lint: .venv/.all ## format, style, types, import contracts
	@$(BIN)/ruff format --check . && $(BIN)/ruff check . && $(BIN)/basedpyright --threads 2 --pythonpath $(BIN)/python && $(BIN)/lint-imports
format: .venv/.all ## rewrite the code in the project's format
	@$(BIN)/ruff format . && $(BIN)/ruff check --fix .
evaluate: .venv/.all ## measure how well it tracks: make evaluate ARGS="all --quick --out results", ARGS=list
	@$(BIN)/python -m evaluation $(ARGS)
faults: .venv/.all ## make every fault ten times and write what came of it to docs/reference/reliability.md: make faults ARGS="--set tries=3"
	@$(BIN)/python -m evaluation faults --out results $(ARGS)
	@$(BIN)/python -m evaluation.service.faults.page results/faults/report.json
bench: .venv/.all ## measure the hot parts, one table and JSON=bench.json; compare minima, machines differ
	@$(BIN)/pytest evaluation/benchmarks --benchmark-enable --benchmark-quiet --benchmark-json=$(JSON) $(ARGS)
cost: .venv/.all ## plot how the cost grows with vertices, population and sensors (docs/images/cost.png)
	@$(BIN)/python -m evaluation.pictures.cost_growth docs/images/cost.png
docs: .venv/.all ## build the documentation site into build/site; a broken link or anchor is an error
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict $(ARGS)
proto: .venv/.all ## regenerate the wire code from proto/absmsg/v1/*.proto
	@$(BIN)/python -m grpc_tools.protoc -Iproto --python_out=proto --pyi_out=proto proto/absmsg/v1/*.proto
constraints: .venv/.all ## resolve the pinned requirements again: make constraints ARGS=--upgrade
	@$(COMPILE) --group build --output-file constraints.txt
	@$(COMPILE) --group dev --group docs --all-extras --constraints constraints.txt --output-file constraints-all.txt
all: .venv/.all ## install everything: device SDKs, what `make evaluate ARGS=peers` compares with, tools
	@echo 'Everything is installed; next:  make run ARGS=--view'
clean: ## remove .venv and every cache
	rm -rf .venv build dist bench.json .pytest_cache .ruff_cache .hypothesis .benchmarks .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/.created:
	@$(PYTHON) -c 'import sys; v = sys.version_info; v < (3, 11) and sys.exit("abs-service needs Python 3.11 or newer, but $(PYTHON) is %d.%d: name another one, for example  make PYTHON=python3.12" % v[:2])'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "$(PYTHON) lacks the venv module:  sudo apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv --clear .venv && touch $@
.venv/.run: .venv/.created constraints.txt pyproject.toml
	@echo "Installing the pinned requirements, a few minutes the first time"
	@$(PIP) --require-hashes --only-binary :all: -r constraints.txt && $(PIP) --no-deps --no-build-isolation -e . && touch $@
.venv/.all: .venv/.run constraints-all.txt
	@echo "Installing all drivers, the live page and the tools, some minutes the first time"
	@$(PIP) --require-hashes --only-binary :all: -r constraints-all.txt && touch $@
.PHONY: help run test check lint format evaluate faults bench cost docs proto constraints all clean
