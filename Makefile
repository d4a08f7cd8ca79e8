# The commands of daily work. `make demo` shows the product, `make check` proves it.
.PHONY: setup build demo check fmt bench evaluation train species layouts
DB := demo/demeter.sqlite
DEMETER := target/debug/demeter
IMAGES := .cache/training/images

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

# Format, lints, dependency rules, every test.
check:
	@tools/check.sh

fmt:
	cargo fmt --all

# Times of the hot paths, in the profile that everything else shares.
bench: setup
	cargo bench --locked --workspace --profile dev --bench '*'

# docs/evaluation.md: every table beside its goals. EVERY=10 takes every tenth cloud.
evaluation: build
	tools/evaluation.sh

# Every network of models/ from pictures of the synthetic world: an hour, and the same command resumes a stopped run.
train: build
	@tools/setup.sh training
	test -d $(IMAGES) || tools/training-pictures.sh $(dir $(IMAGES)) 12000
	nice -n 3 /usr/bin/python3 models/training/train_organ2d.py --data $(IMAGES) --minutes 55

# Every species of recon/species from ../shared and generated plants: ten minutes, most of them growing the plants.
species: build
	tools/learn-species.sh

# Real models of other people for tests/tests/other_models.rs: 230 MB into .cache/layouts, by way of 6 GB of PyTorch.
layouts:
	@tools/layouts.sh
