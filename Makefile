# Reynolds: `make demo` recovers a scene from images, `make test` passes all tests. Both install what is missing.
BUILD ?= build
PREFIX ?= /usr/local
CONFORMANCE ?=
JOBS ?= $(shell nproc)
PACKAGES = gcc g++ make cmake pkg-config libembree-dev libexpat1-dev libopenexr-dev libpng-dev libjpeg62-turbo-dev \
           zlib1g-dev libyaml-dev libsuitesparse-dev libblosc-dev libnanovdb-dev libcmocka-dev python3

.PHONY: all setup demo test test-slow conformance bench bench-large bench-peer check fuzz sanitize tsan install clean

all: $(BUILD)/CMakeCache.txt
	@$(MAKE) --no-print-directory -C $(BUILD) -j$(JOBS)

$(BUILD)/CMakeCache.txt: | setup
	@cmake -S . -B $(BUILD) -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX=$(PREFIX) > /dev/null

# Installs missing Debian packages; does nothing, and needs no rights, when all are there.
setup:
	@sh scripts/setup.sh $(PACKAGES)

# The demo needs the command alone, and no word of how it is made unless that fails.
demo: $(BUILD)/CMakeCache.txt
	@[ -x $(BUILD)/bin/reynolds ] || echo "building $(BUILD)/bin/reynolds, which takes some minutes" >&2
	@$(MAKE) --no-print-directory -C $(BUILD) -j$(JOBS) reynolds > /dev/null
	$(BUILD)/bin/reynolds fit examples/cornell/job.yaml --overwrite

# Boundary terms in whole renders (heavy) take some twenty minutes by themselves: `make test SKIP=slow` runs them, too, as CI does.
# Tests know the noise of a quarter of their samples; with all of them (EFFORT=1) they see smaller errors and take two to four
# times as long.
SKIP ?= slow|heavy
EFFORT ?= 0.25
test: all
	@cd $(BUILD) && REYNOLDS_TEST_EFFORT=$(EFFORT) ctest -j$(JOBS) --output-on-failure -LE '$(SKIP)'

# Half an hour and more: the demo's scene from ten seeds, and all jobs in examples/.
test-slow: all
	@cd $(BUILD) && ctest --verbose -L slow

conformance: all
	@$(BUILD)/bin/conformance $(CONFORMANCE)

bench: all
	@python3 bench/bench.py --reynolds $(BUILD)/bin/reynolds
	@$(MAKE) --no-print-directory -C $(BUILD) -j$(JOBS) tracking > /dev/null && $(BUILD)/bin/tracking $(BUILD)/bench

# A few minutes and 8 GB: meshes, pictures, forests and fog of the largest kind.
bench-large: all
	@python3 bench/large.py --reynolds $(BUILD)/bin/reynolds

bench-peer: all
	@sh bench/peer.sh $(BUILD)/bin/reynolds

check:
	@for script in scripts/check_*.py; do python3 $$script || exit 1; done

# A few minutes of every reader on hostile input (clang). None of them renders: one width of kernels is enough.
FUZZ_SECONDS ?= 60
fuzz:
	@sh scripts/setup.sh $(PACKAGES) clang libclang-rt-14-dev
	@CC=clang cmake -S . -B build-fuzz -DREYNOLDS_FUZZ=ON -DREYNOLDS_SANITIZE=ON -DREYNOLDS_WIDEST=1 > /dev/null
	@$(MAKE) --no-print-directory -C build-fuzz -j$(JOBS) fuzz
	@ls build-fuzz/bin/fuzz_* | xargs -P $(JOBS) -I{} sh scripts/fuzz.sh {} $(FUZZ_SECONDS)

# Sanitizers see in a quarter of the samples what they see in all, and at 8 lanes what they see at 16, which take minutes to build.
sanitize: setup
	@cmake -S . -B build-asan -DREYNOLDS_SANITIZE=ON -DREYNOLDS_WIDEST=8 > /dev/null
	@$(MAKE) --no-print-directory -C build-asan -j$(JOBS)
	@cd build-asan && REYNOLDS_TEST_EFFORT=0.25 ctest -j$(JOBS) --output-on-failure -LE 'slow|heavy|long'

# Threads meet in the same places at every width, and in the first iterations of fits.
tsan: setup
	@cmake -S . -B build-tsan -DREYNOLDS_TSAN=ON -DREYNOLDS_WIDEST=1 > /dev/null
	@$(MAKE) --no-print-directory -C build-tsan -j$(JOBS) threads
	@cd build-tsan && TSAN_OPTIONS="suppressions=$(CURDIR)/tests/tsan.supp" ctest --output-on-failure -L threads

install: all
	@cmake --install $(BUILD) --prefix $(PREFIX)

clean:
	rm -rf build build-asan build-tsan build-fuzz
