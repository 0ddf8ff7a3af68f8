host_FLAGS := $(call system_cflags,eigen3) -isystem /usr/include/opencv4
host_LDLIBS := -lceres -lglog -lopencv_calib3d -lopencv_imgcodecs -lopencv_imgproc -lopencv_core -lfmt -lspdlog -lpthread
# From the socket to the disk: light, so that its tests run under the sanitizers too.
gather_SRC := \
  host/net/packets.cc \
  host/net/listener.cc \
  host/journal/journal_reader.cc \
  host/journal/journal_writer.cc \

$(eval $(call library,gather))

host_SRC := \
  host/base/bspline.cc \
  host/base/chi_square.cc \
  host/base/csv.cc \
  host/base/pose.cc \
  host/base/whole_file.cc \
  host/model/camera.cc \
  host/model/camera_unproject.cc \
  host/model/spline_field.cc \
  host/assoc/instants.cc \
  host/obs/baselines.cc \
  host/obs/digest.cc \
  host/obs/observations_file.cc \
  host/obs/observe.cc \
  host/obs/repeats.cc \
  host/obs/scene.cc \
  host/obs/target_board.cc \
  host/solve/baseline_check.cc \
  host/solve/bundle.cc \
  host/solve/change.cc \
  host/solve/circle_centre.cc \
  host/solve/enrich.cc \
  host/solve/facing.cc \
  host/solve/field_errors.cc \
  host/solve/frame_quadratic.cc \
  host/solve/flexible.cc \
  host/solve/flexible_covariance.cc \
  host/solve/flexible_layout.cc \
  host/solve/flexible_system.cc \
  host/solve/heldout.cc \
  host/solve/hand_eye.cc \
  host/solve/intrinsics.cc \
  host/solve/plane_pose.cc \
  host/solve/pose_graph.cc \
  host/solve/robust.cc \
  host/solve/lens_change.cc \
  host/solve/lens_prior.cc \
  host/solve/moved.cc \
  host/solve/pose_chain.cc \
  host/solve/prior.cc \
  host/solve/prior_check.cc \
  host/solve/prior_poses.cc \
  host/solve/richer.cc \
  host/solve/rig.cc \
  host/solve/rolling_cost.cc \
  host/solve/rolling_information.cc \
  host/solve/rolling_kernel.cc \
  host/solve/row_times.cc \
  host/solve/scale.cc \
  host/solve/seed_opencv.cc \
  host/solve/shutter.cc \
  host/solve/swapped.cc \
  host/solve/surface.cc \
  host/solve/uncertainty.cc \
  host/solve/velocity_elimination.cc \
  host/solve/velocity_prior.cc \
  host/solve/view_cost.cc \
  host/solve/view_kernel.cc \
  host/solve/views.cc \
  host/report/choice_report.cc \
  host/report/compare.cc \
  host/report/compare_rows.cc \
  host/report/compare_text.cc \
  host/report/covariance_json.cc \
  host/report/error_bars.cc \
  host/report/export.cc \
  host/report/export_formats.cc \
  host/report/export_opencv.cc \
  host/report/heat_map.cc \
  host/report/nearest_lens.cc \
  host/report/picture.cc \
  host/report/reach.cc \
  host/report/rig_file.cc \
  host/report/sensitivity.cc \
  host/report/shutter_json.cc \
  host/report/spline_json.cc \
  host/report/statistics.cc \
  host/report/summary.cc \
  host/report/surface_picture.cc \
  host/report/uncertainty_report.cc \

$(eval $(call library,host))

# The host's program; one file a subcommand.
tessera-rig_FLAGS  := $(host_FLAGS)
tessera-rig_LIBS   := host gather targetfile common
tessera-rig_LDLIBS := -lcjson $(host_LDLIBS)
tessera-rig_SRC := \
  host/rig/main.cc \
  host/rig/cmd_receive.cc \
  host/rig/announce.cc \
  host/rig/receiver.cc \
  host/rig/cmd_journal.cc \
  host/rig/cmd_solve.cc \
  host/rig/lens_argument.cc \
  host/rig/cmd_project.cc \
  host/rig/cmd_report.cc \
  host/rig/cmd_export.cc \
  host/rig/cmd_uncertainty.cc \
  host/rig/cmd_compare.cc \

$(eval $(call program,tessera-rig))
