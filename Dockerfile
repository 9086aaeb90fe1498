# The package on ROS 2 Jazzy, built with colcon. 'make test' does not build this image; the job
# 'image' of .github/workflows/ci.yml does.
#
#     docker build --tag cardbox_tracker .
#     docker run --rm -it cardbox_tracker ros2 run cardbox_tracker cardbox --help
#     docker run --rm -it --network host --device /dev/video0 cardbox_tracker \
#         ros2 launch cardbox_tracker live.launch.py device:=/dev/video0 horizontal_fov_deg:=60.0
FROM ros:jazzy

# Without -u: the set-up files of ROS read variables that may be unset.
SHELL ["/bin/bash", "-eo", "pipefail", "-c"]
ENV DEBIAN_FRONTEND=noninteractive
WORKDIR /ws

# The packages of ROS. pip brings numba and OpenCV; RViz is for a machine with a screen.
COPY package.xml src/cardbox_tracker/package.xml
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3-venv \
    && rosdep update --rosdistro jazzy \
    && rosdep install --yes --rosdistro jazzy --from-paths src --ignore-src \
        --dependency-types exec --skip-keys "python3-numba python3-opencv rviz2" \
    && rm -rf /var/lib/apt/lists/*

# A virtual environment that sees the packages of ROS. The messages of Jazzy are compiled for
# NumPy 1. The package itself is left to colcon.
COPY . src/cardbox_tracker
RUN python3 -m venv --system-site-packages /opt/venv \
    && /opt/venv/bin/pip install --no-cache-dir "numpy<2" ./src/cardbox_tracker \
    && /opt/venv/bin/pip uninstall --yes cardbox_tracker
ENV PATH=/opt/venv/bin:$PATH

# Compiled now, the inner loop starts at once on processors like this one.
RUN source /opt/ros/jazzy/setup.bash \
    && python -m colcon build --packages-select cardbox_tracker \
    && source install/setup.bash \
    && python -m cardbox_tracker.tracking.precompile

ENTRYPOINT ["/bin/bash", "-c", "source /ws/install/setup.bash && exec \"$@\"", "--"]
CMD ["bash"]
