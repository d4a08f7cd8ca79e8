# The commands of daily work. `make demo` shows the product, `make check` proves it.
.PHONY: setup build demo install check faults soak fmt bench evaluation train species layouts sync-check
DB := demo/demeter.sqlite
DEMETER := target/debug/demeter
TRAINING := .cache/training

# Debian packages and ONNX Runtime's library, where missing.
setup:
	@tools/setup.sh

# The program. Naming the tests beside it settles one set of features for both, so `make check` reuses every crate.
build: setup
	cargo build --locked --bin demeter --package demeter --package demeter-tests

# The bundled session becomes plants in a fresh database, and a picture of the first of them beside its photo.
demo: build
	@rm -rf demo && mkdir demo
	$(DEMETER) replay tests/fixtures/row --db $(DB)
	$(DEMETER) plants show first --db $(DB) --picture demo/first-plant.png
	@echo "Picture: demo/first-plant.png"
	@echo "Page:    $(DEMETER) run --db $(DB), then open http://127.0.0.1:8420"

# The program as it ships, its networks, units and default configuration, below DESTDIR: docs/service.md goes on.
install: setup
	cargo build --locked --release --bin demeter --package demeter
	tools/install.sh target/release/demeter $(DESTDIR)

# Format, lints, dependency rules, every test.
check:
	@tools/check.sh

# What takes too long or measures too much for `make check`: half an hour.
soak:
	@tools/soak.sh

# What asserts times and memory, and the long counts of what `check` runs in short: alone on the machine, half an hour.
faults:
	@tools/faults.sh

fmt:
	cargo fmt --all

# Times of the hot paths, in the profile that everything else shares.
bench: setup
	cargo bench --locked --workspace --profile dev --bench '*'

# docs/evaluation.md: every table beside its goals. EVERY=10 takes every tenth cloud.
evaluation: build
	tools/evaluation.sh

# The networks of models/, those of pictures from the same data: an hour each, data apart, and the same command resumes a stopped run.
# The files that ship came from chains of shorter runs, which their manifests tell: docs/training.md.
train: build
	@tools/setup.sh training
	test -d $(TRAINING)/images || tools/training-pictures.sh $(TRAINING) 12000
	nice -n 3 /usr/bin/python3 models/training/train_organ2d.py --data $(TRAINING)/images --minutes 55
	nice -n 3 /usr/bin/python3 models/training/train_relief2d.py --data $(TRAINING)/images --minutes 55
	test -d $(TRAINING)/clouds || tools/training-clouds.sh $(TRAINING)/clouds
	nice -n 3 /usr/bin/python3 models/training/train_organ3d.py --minutes 55 \
		$(foreach set,helios demeter seedlings,--data $(TRAINING)/clouds/$(set))

# Every species of recon/species from ../shared and generated plants: ten minutes, most of them growing the plants.
species: build
	tools/learn-species.sh

# Real models of other people for tests/tests/other_models.rs: 230 MB into .cache/layouts, by way of 6 GB of PyTorch.
layouts:
	@tools/layouts.sh

# The sync against a real S3 server, read back by DuckDB and pyarrow: builds Garage once, 12 minutes.
sync-check: build
	@tools/sync-check.sh
